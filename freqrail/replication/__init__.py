"""The paper's study redone: its claims as functions, its figures, what its procedure does, and the report.

judging, claims, studies -> printed, variations, procedures, time_variations -> document, report, figures -> folder.
"""
