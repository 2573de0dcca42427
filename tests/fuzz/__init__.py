"""Damaged inputs by the thousand: `python -m tests.fuzz --cases 20000 --netcdf 2000 --seed 1`.

Case files and option strings are changed at random and loaded in this process; result files are damaged and read in
child processes with limits on time and memory. A fault is a traceback, a hang, a message of the wrong form, or a
number that is not what was written.
"""
