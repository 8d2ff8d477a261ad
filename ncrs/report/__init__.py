"""A run as a page that opens in any browser, offline: overview, archive, robots, episodes.

Importing this package needs neither jinja2 nor numba; building a report does.
"""

from ncrs.report.build import REPORT_FOLDER, Report, ReportOptions, build_report, build_robot_report
from ncrs.report.robots import ReportError

__all__ = [
    "REPORT_FOLDER",
    "Report",
    "ReportError",
    "ReportOptions",
    "build_report",
    "build_robot_report",
]
