"""Vehicles far from any that runs, against arithmetic of forty digits and more.

    python -m tests.extremes --count 2000 --seed 1 --jobs 2

Values of a plausible case are moved by up to nine decades each way, within what a case file accepts: cut-offs that
merge, joints from soft to rigid, 1 m/h to 600 km/h, both models, the whole axis and bands. What `freqrail.sweep`
returns (values, error estimates, statuses) is held against `forty_digits`, which shares no code with freqrail. The
campaign goes through what users see, so that it holds for any kernel below.

`forty_digits`: the reference. `draws`: the vehicles. `check`: what counts as a violation.
"""
