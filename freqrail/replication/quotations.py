"""The paper's own words: for every claim the sentence that makes it, verbatim but for line breaks.

Sentences of Y. Yu, Y. Song, L. Zhao, C. Zhou, "Numerical Investigation on Train Vertical Dynamics with Damper Rubber
Joint Stiffness". One sentence may make several claims. Nothing is left out of a sentence and nothing is mended in it.

Two clauses that have a direction are no claims: of V.B, "has little impact on its low frequency characteristics", and
of VI.B 4, "and the more consistent the change law is". The report gives the numbers of both (`unjudged`).
"""

from __future__ import annotations

_SENTENCES: dict[tuple[str, ...], str] = {
    ("V.A a",): (
        "According to the analysis of Figure 3, we can see that, the changes of the track vertical irregularity "
        "at each wheel-set are consistent, and there is only a certain lag in time between the four wheel-sets."
    ),
    ("V.B b", "V.B c"): (
        "As displayed in Figure 4, the car body acceleration and secondary suspension vertical stroke is "
        "basically identical under the two models."
    ),
    ("V.B d", "V.B e"): (
        "In addition, the bogie frame vertical acceleration and primary suspension vertical stroke are somewhat "
        "different."
    ),
    ("V.B f",): (
        "The high-frequency vibration response components (affected by damper rubber joint stiffness) and the "
        "basic response (refer to the traditional railway vehicle model shown in Figure 1) are mixed together, "
        "which makes the difference between the analysis results of the bogie frame larger, while the difference "
        "between the analysis results of the car body smaller."
    ),
    ("V.B g",): (
        "The reason for this difference is that, the impact of the rubber joint stiffness of the damper on the "
        "train is mainly reflected in its high frequency range, has little impact on its low frequency "
        "characteristics."
    ),
    ("VI.A 1a",): (
        "The effect of the primary damper rubber joint stiffness on car body vertical acceleration is mainly "
        "reflected in the lower vehicle running speed."
    ),
    ("VI.A 1b", "VI.A 1c", "VI.A 1d"): (
        "When the vehicle is running at a low speed, the car body vertical acceleration with primary vertical "
        "damper rubber joint stiffness is less than that of the traditional model, and is basically consistent "
        "with the traditional model when the running speed is high, but as long as the joint stiffness exists, "
        "the car body vertical acceleration under two models will not be coincidence."
    ),
    ("VI.A 1e", "VI.A 1f"): (
        "In terms of the damper rubber joint stiffness, with the increase of the stiffness of the primary damper "
        "rubber joint, the car body acceleration shows a decreasing trend, and the higher the vehicle speed is, "
        "the more obvious this effect is."
    ),
    ("VI.A 1g", "VI.A 1h"): (
        "In addition, when the primary vertical damper joint stiffness increases to a certain extent, the car "
        "body acceleration is gradually close to that without considering the impact of the damper joint "
        "stiffness, but the change is very slow."
    ),
    ("VI.A 2a", "VI.A 2b"): (
        "Compared with the traditional model, the primary vertical damper rubber joint stiffness has a certain "
        "influence on the bogie frame acceleration at different vehicle running speed, which is more significant "
        "at the lower vehicle running speed."
    ),
    ("VI.A 2c", "VI.A 2d"): (
        "When the vehicle is running at a low speed, the bogie frame vertical acceleration with considering the "
        "effect of the primary vertical damper rubber joint stiffness is less than that of the traditional model,"
        " but when the vehicle running speed is high, it is greater than that of the traditional model."
    ),
    ("VI.A 2e", "VI.A 2f"): (
        "In terms of the damper rubber joint stiffness, the greater the primary vertical damper joint stiffness "
        "is, the greater the bogie frame vertical acceleration will be, and the impact of the primary damper "
        "rubber joint stiffness on the vertical acceleration of the bogie frame increases with the increase of "
        "vehicle running speed."
    ),
    ("VI.A 3a",): (
        "Whether considering the effect of the primary vertical damper rubber joint stiffness or not, the "
        "vertical stroke of the secondary suspension changes little."
    ),
    ("VI.A 3b", "VI.A 3c"): (
        "In terms of the primary vertical damper rubber joint stiffness, the greater the joint stiffness is, the "
        "smaller the secondary suspension vertical stroke will be, and the influence of the joint stiffness of "
        "the primary vertical damper on the vertical stroke of the secondary suspension increases with the "
        "increase of vehicle speed."
    ),
    ("VI.A 3d", "VI.A 3e"): (
        "In addition, when the primary vertical damper joint stiffness increases to a certain extent, the "
        "secondary suspension vertical stroke with considering the effect of the primary vertical damper rubber "
        "joint stiffness gradually approaches the traditional model, but the change is very slow."
    ),
    ("VI.A 3f",): (
        "As long as the joint stiffness exists, the secondary suspension vertical stroke under the two models can"
        " not coincide."
    ),
    ("VI.A 4a", "VI.A 4b"): (
        "Increasing the primary vertical damper rubber joint stiffness, the primary suspension vertical stroke "
        "firstly gradually approaches the traditional model, and then gradually moves away from it, and this "
        "effect is more obvious and higher with the increase of the vehicle running speed."
    ),
    ("VI.A 4c",): (
        "In terms of the damper rubber joint stiffness, the greater the primary vertical damper joint stiffness "
        "is, the smaller the primary suspension vertical stroke will be."
    ),
    ("VI.A 4d",): (
        "The variation law of the vertical stroke of the primary suspension with the rubber joint stiffness of "
        "the primary vertical damper is basically the same under the different vehicle running speed."
    ),
    ("VI.B 1a",): (
        "The effect of the secondary damper rubber joint stiffness on car body vertical acceleration is mainly "
        "reflected in the lower vehicle running speed."
    ),
    ("VI.B 1b", "VI.B 1c", "VI.B 1d"): (
        "When the vehicle is running at a low speed, the car body vertical acceleration with secondary vertical "
        "damper rubber joint stiffness is less than that of the traditional mode, and is basically the same as "
        "that of traditional model when the vehicle running speed is high, but as long as the joint stiffness "
        "exists, the car body vertical acceleration under two models will not be coincidence."
    ),
    ("VI.B 1e", "VI.B 1f"): (
        "In terms of the damper rubber joint stiffness, with the increase of the stiffness of the secondary "
        "damper rubber joint, the car body acceleration shows a decreasing trend, and this effect is basically "
        "the same at different vehicle running speed."
    ),
    ("VI.B 1g",): (
        "In addition, when the secondary vertical damper rubber joint stiffness increases to a certain extent, "
        "and the vehicle speed is high, the car body vertical acceleration will gradually approach traditional "
        "model."
    ),
    ("VI.B 2a", "VI.B 2b"): (
        "Compared with the traditional model, the secondary vertical damper rubber joint stiffness has a certain "
        "influence on the bogie frame acceleration at different vehicle running speed, which is more significant "
        "at the lower vehicle running speed."
    ),
    ("VI.B 2c", "VI.B 2d"): (
        "When the vehicle is running at a low speed, the bogie frame vertical acceleration with considering the "
        "effect of secondary vertical damper rubber joint stiffness is less than that of the traditional model, "
        "but at the high vehicle running speed, with the increase of the secondary vertical damper joint "
        "stiffness, it gradually approaches the traditional model."
    ),
    ("VI.B 2e", "VI.B 2f"): (
        "In terms of the damper rubber joint stiffness, the greater the secondary vertical damper joint stiffness"
        " is, the smaller the bogie frame vertical acceleration will be, and the variation law of the bogie frame"
        " vertical acceleration with the rubber joint stiffness of the secondary vertical damper is basically the"
        " same under the different vehicle running speed."
    ),
    ("VI.B 3a", "VI.B 3b"): (
        "With the increase of the secondary vertical damper rubber joint stiffness, the vertical stroke of the "
        "secondary suspension gradually approaches the traditional model, and when the secondary vertical damper "
        "joint stiffness increases to a certain extent, the secondary suspension vertical stroke under the two "
        "models is basically the same."
    ),
    ("VI.B 3c", "VI.B 3d"): (
        "In terms of the damper rubber joint stiffness, the greater the secondary vertical damper joint stiffness"
        " is, the smaller the secondary suspension vertical stroke will be, and the variation law of the vertical"
        " stroke of the secondary suspension with the rubber joint stiffness of the secondary vertical damper is "
        "basically the same under the different vehicle running speed."
    ),
    ("VI.B 4a",): (
        "The smaller the secondary vertical damper rubber joint stiffness is, the closer the primary suspension "
        "vertical stroke under the two models is, and the more consistent the change law is."
    ),
    ("VI.B 4b",): (
        "In terms of the damper rubber joint stiffness, the greater the secondary vertical damper joint stiffness"
        " is, the smaller the primary suspension vertical stroke will be."
    ),
    ("VI.B 4c",): (
        "In addition, the variation law of the vertical stroke of the primary suspension with the rubber joint "
        "stiffness of the secondary vertical damper is basically the same under the different vehicle running "
        "speed."
    ),
    ("VII 1",): (
        "The car body vertical acceleration, the bogie frame vertical acceleration, the secondary suspension "
        "vertical stroke, and the primary suspension vertical stroke are significantly affected by the rubber "
        "joint stiffness of the primary and secondary vertical dampers."
    ),
    ("VII 2a",): (
        "The traditional model will cause great errors in calculating the car body vertical acceleration and the "
        "bogie frame vertical acceleration in the low vehicle running speed range."
    ),
    ("VII 2b",): (
        "When the damper rubber joint stiffness increases to a certain extent, the results of the vibration "
        "response analysis tend to be consistent."
    ),
    ("VII 3",): (
        "By selecting a proper damper rubber joint stiffness, the vibration of the railway vehicle can be alleviated."
    ),
}

QUOTATIONS: dict[str, str] = {key: sentence for keys, sentence in _SENTENCES.items() for key in keys}
"""By the key of a claim, whose first word is the section: the sentence of the paper that makes it."""
