"""Reports as pages."""

from lab3_usd.hooks import Feature, Format

FEATURE = Feature(
    formats={
        "html": Format("lab3_usd.report.html.report_page", "one self-contained page", manual=True)
    },
    answers={
        "end_live_page": "lab3_usd.report.html.live_page",
        "write_live_page": "lab3_usd.report.html.live_page",
    },
)
