"""The report of a build: one HTML file that needs nothing else."""

from evaluation.report.page import write_report
from evaluation.report.pictures import Picture, PictureSet

__all__ = ["Picture", "PictureSet", "write_report"]
