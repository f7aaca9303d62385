"""The view of a study that MLflow's page draws itself: the paper's Figure 4, one panel a scene, one line a selector.

MLflow keeps a shared view in a tag of the experiment, as JSON or as zlib's deflate in base64, and its page reads it
when the address names the tag's key (useSharedExperimentViewState.ts in mlflow/mlflow). The menu "Views" of newer
versions lists the tags that have an envelope with a name around that (savedViewEnvelope.ts), from which MLflow 3.13
reads nothing. So there are two tags: one that every version opens by the link, and one for the menu. Tried with MLflow
3.13.0, 3.17.2 and 3.18.0; fields are those of ExperimentPageUIState.tsx, ExperimentPageSearchFacetsState.tsx and
runs-charts.types.ts.
"""

import base64
import hashlib
import json
import urllib.parse
import zlib
from collections.abc import Sequence
from typing import Any

from ._tracked_run import KIND, SHARE

KEY = "viewbench"  # names the view in the link
PREFIX = "mlflow.sharedViewState."
LONGEST = 5000  # letters of an experiment's tag in MLflow 3.13; 3.17 takes 20000
TRAINING = "workflowType=machine_learning"  # without it, a new browser gets the page for language models
FIGURE, FURTHER = "Figure 4: PSNR over the share of training views", "Further figures over the share of training views"
OTHERS = "Model metrics"  # the section where the page puts a chart of every metric that has none
FURTHER_METRICS = ("ssim", "train_s")
COLUMNS = (
    "params.`scene`",
    "params.`selector`",
    "params.`backend`",
    "metrics.`psnr_db`",
    "metrics.`ssim`",
    "metrics.`train_s`",
    "attributes.`Dataset`",
)


def tags(panels: Sequence[str], created_ms: int, further: Sequence[str] = FURTHER_METRICS) -> dict[str, str]:
    """The experiment's tags, by key; `panels` are the metrics of the figure, one a panel, in the order of the panels.

    A panel's title is its metric's name, in all versions. Charts for which a tag has no room (some 150 fit), the
    `further` ones first, are left to the page, which draws them below the others, over the step. `created_ms` orders
    the menu.
    """
    panels, further = list(dict.fromkeys(panels)), list(dict.fromkeys(further))
    while True:
        state = _compressed(_state(panels, further))
        named = json.dumps({"name": FIGURE, "createdAt": created_ms, "state": state})
        if len(named) <= LONGEST or not panels:
            return {PREFIX + KEY: state, PREFIX + KEY + "-menu": named}
        panels, further = (panels, further[:-1]) if further else (panels[:-1], further)


def link(server: str, experiment_id: str) -> str:
    """Address of the view on a server such as http://127.0.0.1:5000; without a server, from any of its pages.

    It must not name a filter or an order: the page would take those for the reader's own, and not read the tag.
    """
    return f"{_runs(server, experiment_id)}?viewStateShareKey={KEY}&compareRunsMode=CHART&{TRAINING}"


def runs_link(server: str, experiment_id: str) -> str:
    """Address of the table of runs."""
    return f"{_runs(server, experiment_id)}?{TRAINING}"


def run_link(server: str, experiment_id: str, run: str, rest: str = "") -> str:
    """Address of a run, or with `rest` of what is below its page: "/artifacts/index.html"."""
    return f"{_runs(server, experiment_id)}/{run}{rest}?{TRAINING}"


def _runs(server: str, experiment_id: str) -> str:
    base = f"{server.rstrip('/')}/" if server else ""
    return f"{base}#/experiments/{urllib.parse.quote(experiment_id, safe='')}/runs"


def _state(panels: list[str], further: list[str]) -> dict[str, Any]:
    charts = [_chart(metric, FIGURE) for metric in panels]
    charts += [_chart(metric, FURTHER) for metric in further if metric not in panels]
    columns = 2 if len(panels) in (1, 2, 4) else 3
    return {
        "searchFilter": f"tags.`{KIND}` = 'summary'",
        # A page has the first 100 runs until one asks for more: so ordered, its panels have all of their lines.
        "orderByKey": "params.`scene`",
        "orderByAsc": True,
        "startTime": "ALL",
        "lifecycleFilter": "Active",
        "modelVersionFilter": "All Runs",
        "datasetsFilter": [],
        "selectedColumns": list(COLUMNS),
        "runsExpanded": {},
        "runsPinned": [],
        "runsHidden": [],
        "runsVisibilityMap": {},
        "runsHiddenMode": "SHOW_ALL",
        "compareRunCharts": charts,
        "compareRunSections": [
            _section(FIGURE, True, columns),
            _section(FURTHER, True, 2),
            _section(OTHERS, False, 3),
        ],
        "viewMaximized": False,
        "runListHidden": False,
        "isAccordionReordered": True,  # keeps the order of the sections
        "groupBy": None,
        "groupsExpanded": {},
        "autoRefreshEnabled": True,
        "useGroupedValuesInCharts": True,
        "hideEmptyCharts": True,
        "globalLineChartConfig": {"xAxisKey": "metric", "lineSmoothness": 0, "selectedXAxisMetricKey": SHARE},
        "chartsSearchFilter": "",
    }


def _section(name: str, opened: bool, columns: int) -> dict[str, Any]:
    return {
        "uuid": _short(name),
        "name": name,
        "display": opened,
        "isReordered": True,
        "deleted": False,
        "isGenerated": False,
        "columns": columns,
        "cardHeight": 400,
    }


def _chart(metric: str, section: str) -> dict[str, Any]:
    return {
        "uuid": _short(metric),
        "type": "LINE",
        "metricSectionId": _short(section),
        "deleted": False,
        "isGenerated": False,
        "metricKey": metric,
        "selectedMetricKeys": [metric],
        "lineSmoothness": 0,
        "xAxisScaleType": "linear",
        "scaleType": "linear",
        "xAxisKey": "metric",
        "selectedXAxisMetricKey": SHARE,
        "displayPoints": True,
        "useGlobalXaxisKey": False,
        "useGlobalLineSmoothing": False,
    }


def _short(text: str) -> str:
    """The id of a chart or a section, from its name: any text is one, and random letters are not compressed."""
    return hashlib.sha256(text.encode(errors="surrogatepass")).hexdigest()[:8]


def _compressed(state: dict[str, Any]) -> str:
    text = json.dumps(state, separators=(",", ":"))
    return "deflate;" + base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii")
