"""The paper's study redone: its claims as functions, its figures, what its procedure does, and the report.

thresholds, words, quotations -> judging -> claims -> standing, studies, yielding_rail, mechanism -> printed,
variations, procedures, time_variations -> document, figures, explanation, report -> folder.
"""
