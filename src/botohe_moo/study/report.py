"""The report of a study: a page that embeds its figures and styles, and tables in LaTeX.

The captions of its figures are in ``captions.toml``.
"""

import base64
import functools
import hashlib
import itertools
import math
import multiprocessing
import re
import signal
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from botohe_moo.base.files import check_folder, replace_file
from botohe_moo.base.messages import counted
from botohe_moo.indicators import INDICATORS
from botohe_moo.plots import comparisons, front
from botohe_moo.plots.style import palette_of, save_plot
from botohe_moo.study.content import parameter_words
from botohe_moo.study.statistics import TOO_FEW, best_first
from botohe_moo.study.tables import SCHEMAS, StudyTables

FORMATS = ("png", "pdf", "svg")
_SHARES = np.arange(50, 100) / 100  # of the reference front's area, as targets
_CAPTIONS = tomllib.loads(Path(__file__).with_name("captions.toml").read_text("utf-8"))

Picture = tuple[str, Axes, str]  # name, axes, caption
Figure = tuple[list[Path], str]  # its files, one for each of FORMATS, and its caption
_LONGEST_SLUG = 60
MARKS = BETTER, EQUAL, WORSE = ("+", "=", "–")  # of a median beside another
_HEADINGS = {"n": "runs", "p_holm": "p (Holm)", "p_value": "p (Nemenyi)"}
_LATEX = r"""%% %s
\begin{center}\footnotesize
\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%%
%s}
\end{center}
"""
# What pandas leaves as it is. After the end of a row, [ would begin an option.
_ESCAPES = {"<": r"\textless{}", ">": r"\textgreater{}", "|": r"\textbar{}", "[": "{[}"}
_SIGNS = {"−": "-", "±": r"\pm", "×": r"\times", "≤": r"\leq", "≥": r"\geq", "ο": "o"}
_GREEK = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi omicron pi rho"
_GREEK += " varsigma sigma tau upsilon phi chi psi omega"
_MATHS = {chr(ord("α") + i): rf"\{name}" for i, name in enumerate(_GREEK.split())} | _SIGNS
_ESCAPED = str.maketrans(_ESCAPES | {sign: f"${name}$" for sign, name in _MATHS.items()})


def number_text(number: float) -> str:
    """Return a number with four significant digits, or whole; a tiny one as 1.234e-09."""
    if not math.isfinite(number) or number == int(number):
        return f"{number:,.0f}"
    places = 3 - math.floor(math.log10(abs(number)))
    return f"{number:,.{max(places, 0)}f}" if places <= 8 else f"{number:.4g}"


def slug(label: str) -> str:
    """Return a label as part of a file's name; different labels give different names."""
    plain = re.sub(r"[^a-z0-9._-]+", "-", label.lower()).strip(".-_")[:_LONGEST_SLUG]
    if plain == label:
        return plain
    # Two labels may differ only in characters that are left out.
    return f"{plain}-{hashlib.sha256(label.encode()).hexdigest()[:8]}".lstrip("-")


def further_of(tables: StudyTables) -> list[str]:
    """Return the indicators that the study names beside the area and the size of the front."""
    return [name for name in tables.manifest["indicators"] if name not in ("area", "front_size")]


def main_indicator(tables: StudyTables) -> str:
    """Return the indicator that algorithms are ranked by: the area, or the first one without it."""
    compared = dict.fromkeys(tables.comparisons["indicator"])
    return "area" if "area" in compared else next(iter(compared), "area")


@dataclass(frozen=True)
class ReportTable:
    """A table of the report, which pandas' Styler writes as HTML and as LaTeX."""

    cells: pd.DataFrame
    bold: Mapping[Any, Any] = field(default_factory=dict)  # which cells of a column

    def html(self, number: int) -> str:
        """Return it for a page, in which each table has another number."""
        styler = self._styler(self.cells, "html")
        right: Any = [{"selector": "", "props": "text-align: right; white-space: nowrap"}]
        styler.set_table_styles(dict.fromkeys(self.cells.select_dtypes("number"), right))
        return str(styler.to_html(table_uuid=number))

    def latex(self, corner: str) -> str:
        """Return it as a ``tabular`` with booktabs; ``corner`` stands above its first column.

        Letters of other scripts than Greek are left to XeLaTeX and LuaLaTeX.
        """
        cells = self.cells.rename(columns={self.cells.columns[0]: f" {corner}"})
        text: str = self._styler(cells, "latex").to_latex(hrules=True, convert_css=True)
        return text.translate(_ESCAPED)

    def _styler(self, cells: pd.DataFrame, escape: str) -> Any:
        styles = pd.DataFrame("", cells.index, cells.columns)
        for column, bold in self.bold.items():
            styles.loc[np.asarray(bold), column] = "font-weight: bold"
        formats = dict.fromkeys(cells.select_dtypes("number"), number_text)
        styler: Any = cells.style.hide(axis="index").apply(lambda _: styles, axis=None)
        styler.format_index(escape=escape, axis=1)
        return styler.format(formats, escape=escape, na_rep="–")


def _headed(rows: pd.DataFrame) -> pd.DataFrame:
    """Return columns of the study's tables with headings; medians are not named as such."""
    names = rows.rename(columns=_HEADINGS).columns
    names = names.str.removesuffix("_median").str.replace("_", " ").str.replace("a12", "A12")
    return rows.set_axis(names, axis="columns").reset_index(drop=True)


def summary_table(tables: StudyTables) -> ReportTable:
    """Return the summary of one mission's tables, a row for each algorithm; the best is bold."""
    further = {f"{name}_median": INDICATORS[name].label for name in further_of(tables)}
    shown = ["algorithm", "n", "n_not_done", "area_median", "area_low", "area_high", "area_mean"]
    shown += ["area_share", "area_gap", *further]
    shown += ["front_size_median", "evaluations_median", "seconds_median"]
    cells = tables.summary[shown].rename(columns=further).dropna(axis="columns", how="all")
    ranks = tables.summary["rank"]
    return ReportTable(_headed(cells), {"area": ranks == ranks.min()})


def comparison_table(rows: pd.DataFrame) -> ReportTable:
    """Return comparisons, a row for each pair; significant p-values are bold."""
    cells = rows.drop(columns=["mission", "n", "n_other", "p_value", "significant"])
    cells["indicator"] = [INDICATORS[name].label for name in rows["indicator"]]
    return ReportTable(_headed(cells), {"p (Holm)": rows["significant"]})


def rank_table(rows: pd.DataFrame) -> ReportTable:
    """Return the average ranks by an indicator, the best first, ties as in the study file."""
    shown = rows[["algorithm", "average_rank", "n_missions"]]
    return ReportTable(_headed(shown.sort_values("average_rank", kind="stable")))


def posthoc_table(rows: pd.DataFrame) -> ReportTable:
    """Return the pairs of average ranks by an indicator; significant p-values are bold."""
    shown = rows[["algorithm", "other", "difference", "p_value"]]
    return ReportTable(_headed(shown), {"p (Nemenyi)": rows["significant"]})


def target_table(rows: pd.DataFrame) -> ReportTable:
    """Return what it took to reach shares of the reference area."""
    shown = ["share", "algorithm", "n_reached", "n", "evaluations_median", "seconds_median"]
    return ReportTable(_headed(rows[shown].sort_values("share", kind="stable")))


def mission_table(tables: StudyTables) -> ReportTable:
    """Return the missions of a study, a row for each."""
    entries = tables.manifest["missions"].values()
    sources = [entry["source"] for entry in entries]
    given = [{key: of[key] for key in of if key != "name_or_path"} for of in sources]
    cells = tables.missions[["mission", "name"]].assign(
        parameters=list(map(parameter_words, given)),
        evaluations=[entry["budget"].get("evaluations") for entry in entries],
        seconds=[entry["budget"].get("seconds") for entry in entries],
    )
    described = ["min_survival", "max_length", "nodes", "arcs", "robots", "total_reward"]
    cells = cells.join(tables.missions[described])
    return ReportTable(_headed(cells.dropna(axis="columns", how="all")))


def algorithm_table(tables: StudyTables) -> ReportTable:
    """Return the algorithms of a study, with the parameters that differ among them."""
    parameters = tables.algorithms.drop(columns=[*SCHEMAS["algorithms"]]).astype(object)
    shown = [parameter_words(dict(row.dropna())) for _, row in parameters.iterrows()]
    return ReportTable(tables.algorithms[["algorithm", "name"]].assign(parameters=shown))


def matrix(tables: StudyTables) -> ReportTable:
    """Return medians of all algorithms on all missions, with marks and ranks; best ones are bold.

    The rows are the more numerous of both.
    """
    missions, algorithms = tables.mission_labels, tables.algorithm_labels
    main, summary = main_indicator(tables), tables.summary
    found = summary.pivot_table(f"{main}_median", "algorithm", "mission")
    medians = found.reindex(index=algorithms, columns=missions)
    ranks = medians.apply(lambda of: pd.Series(best_first(main, of.dropna()), of.dropna().index))
    ranks = ranks.reindex(algorithms).rank()
    best = ranks == ranks.min()
    marks = pd.DataFrame("", algorithms, missions)
    tested = tables.comparisons
    tested = tested[(tested["indicator"] == main) & (tested["verdict"] != TOO_FEW)]
    for row in tested.to_dict("records"):
        mission, pair = row["mission"], (row["algorithm"], row["other"])
        rival = tables.control or best[mission].idxmax()
        if rival in pair:
            label = pair[pair[0] == rival]
            is_better = (row["a12"] > 0.5) == (label == pair[0])  # A12 is that of the first
            mark = BETTER if is_better else WORSE
            marks.loc[label, mission] = f" {mark}" if row["significant"] else f" {EQUAL}"
    texts = medians.map(number_text) + marks + ranks.map(" ({:g})".format)
    cells = texts.where(medians.notna(), "–")
    overall = tables.ranks[tables.ranks["indicator"] == main].set_index("algorithm")
    if len(missions) > 1 and len(overall):
        averages = overall["average_rank"].reindex(algorithms)
        # Labels do not begin with a space, and may be the same otherwise.
        cells[" average rank"] = averages.map(number_text)
        best[" average rank"] = averages == averages.min()
    name = " algorithm"
    if len(algorithms) < len(missions):
        name, cells, best = " mission", cells.T, best.T
    return ReportTable(cells.rename_axis(name).reset_index(), best.to_dict("list"))


def matrix_caption(tables: StudyTables) -> str:
    """Return the caption of the matrix: what it shows, and how to read it."""
    name = INDICATORS[main_indicator(tables)].label
    rival = tables.control or "the best on the mission"
    level = tables.manifest["comparison"]["significance"]
    return (
        f"Median {name} over runs, the best on a mission bold, its rank there in brackets. "
        f"{BETTER} is better than {rival}, {WORSE} worse, {EQUAL} not told apart from it "
        f"(Mann-Whitney, Holm, {level:g}); without a mark there are too few runs to tell."
    )


def tables_latex(tables: StudyTables) -> dict[str, str]:
    """Return the files of the report in LaTeX, by their names."""
    compared: Any = tables.comparisons.groupby(["mission", "indicator"], sort=False)
    ranked: Any = tables.ranks.groupby("indicator", sort=False)
    shown = {label: tables.of_mission(label) for label in tables.summary["mission"].unique()}
    parts = {
        "outcome.tex": [(matrix_caption(tables), "", matrix(tables))],
        "summary.tex": [("Medians", label, summary_table(of)) for label, of in shown.items()],
        "comparisons.tex": [
            ("Mann-Whitney", mission, comparison_table(rows)) for (mission, _), rows in compared
        ],
        "ranks.tex": [
            (rows["note"].iloc[0], INDICATORS[indicator].label, rank_table(rows))
            for indicator, rows in ranked
        ],
    }
    return {
        file: "% Needs booktabs and graphicx.\n"
        + "".join(_LATEX % (comment, table.latex(corner)) for comment, corner, table in tables_of)
        for file, tables_of in parts.items()
    }


def draw_figures(tables: StudyTables, folder: Path, *, workers: int = 1) -> dict[str, list[Figure]]:
    """Draw and save all figures of a study; return them by mission.

    Under ``""`` are those of the study as a whole; a mission without runs has none. Each of
    several workers is a process that draws the figures of one mission after the other.
    """
    palette, labels = palette_of(tables.algorithm_labels), tables.mission_labels
    figures = {"": [_saved(folder, *picture) for picture in _of_study(tables, palette)]}
    parts = [tables.of_mission(label) for label in labels]
    draw = functools.partial(_draw_mission, folder, palette)
    if (n := min(workers, len(labels))) == 1:
        return figures | dict(zip(labels, map(draw, parts, labels), strict=True))
    context = multiprocessing.get_context("spawn")
    silent = signal.SIGINT, signal.SIG_DFL  # Ctrl-C ends workers without a traceback
    with ProcessPoolExecutor(n, context, signal.signal, silent) as pool:
        return figures | dict(zip(labels, pool.map(draw, parts, labels), strict=True))


def _draw_mission(
    folder: Path, palette: dict[str, Any], tables: StudyTables, label: str
) -> list[Figure]:
    pictures = _of_mission(tables, label, palette)
    return [_saved(folder, f"{name}-{slug(label)}", ax, said) for name, ax, said in pictures]


def _saved(folder: Path, name: str, ax: Axes, caption: str) -> Figure:
    paths = [folder / f"{name}.{end}" for end in FORMATS]
    save_plot(ax, *paths)
    return paths, caption


def _caption(name: str, **values: Any) -> str:
    return " ".join(_CAPTIONS[name].split()).format(**values)


def _of_study(tables: StudyTables, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the pictures of several missions, if there are several."""
    summary, main = tables.summary, main_indicator(tables)
    if len(summary["mission"].unique()) > 1 and summary["area_share"].notna().any():
        ax = comparisons.plot_shortfalls(summary, tables.missions, palette=palette)
        yield "shortfalls", ax, _caption("shortfalls")
    ranks = tables.ranks[tables.ranks["indicator"] == main]
    pairs = tables.posthoc[tables.posthoc["indicator"] == main]
    if not pairs.empty:  # otherwise their differences were not tested
        critical = pairs["critical_difference"].iloc[0]
        caption = _caption("ranks", indicator=INDICATORS[main].label, critical=critical)
        ax = comparisons.plot_ranks(ranks, pairs, palette=palette)
        yield f"critical-difference-{main}", ax, caption


def _of_mission(tables: StudyTables, label: str, palette: dict[str, Any]) -> Iterator[Picture]:
    """Draw the pictures of one mission, each when it is asked for; it has all rows of tables."""
    runs, trace, plans, summary = tables.runs, tables.trace, tables.plans, tables.summary
    if runs.empty:
        return
    area = tables.missions["bound_area"].iloc[0]
    bound = None if pd.isna(area) else float(area)
    if not trace.empty:
        yield from _over_time(tables, palette, bound)
    ax = comparisons.plot_areas(runs, summary, bound=bound, palette=palette)
    yield "areas", ax, _caption("areas")
    medians = summary.set_index("algorithm")["area_median"]
    grids = comparisons.two_parameter_grids(tables.algorithms)
    for i, (family, grid) in enumerate(grids.items(), start=1):
        values = grid.apply(lambda column: column.map(medians)).astype(float)
        if values.notna().any(axis=None):
            yield f"grid-{i}", comparisons.plot_heat(values), _caption("grid", family=family)
    if plans.empty:
        return
    objectives = tables.objectives(label)
    if not objectives.is_plain:
        seeds = {name: front.median_run(own) for name, own in runs.groupby("algorithm")}
        shown = plans[plans["seed"] == plans["algorithm"].map(seeds)]
        ax = front.plot_pairs(shown, objectives, hue="algorithm", palette=palette)
        yield "fronts", ax, _caption("pairs")
        return
    lines: Any = {"reference": tables.references, "bound": None if bound is None else tables.bounds}
    yield "fronts", front.plot_fronts(plans, runs, **lines, palette=palette), _caption("fronts")
    yield "attainment", front.plot_attainment(plans, runs, palette=palette), _caption("attainment")
    if pair := rivals(tables):
        ax, _ = front.plot_attainment_difference(plans, runs, *pair, palette=palette)
        yield "difference", ax, _caption("difference", first=pair[0], second=pair[1])


def _over_time(
    tables: StudyTables, palette: dict[str, Any], bound: float | None
) -> Iterator[Picture]:
    """Draw how areas grow, how targets are reached, and how distances shrink."""
    trace, targets = tables.trace, tables.targets
    spent: tuple[comparisons.Spent, ...] = ("evaluations", "seconds")
    for x, name in zip(spent, ("curves", "seconds"), strict=True):
        ax = comparisons.plot_curves(trace, x=x, bound=bound, palette=palette)
        yield name, ax, _caption("curves", spent=comparisons.NAMES[x])
    if not targets.empty:  # else the reference front has no area
        shown = _SHARES * (targets["target"].iloc[0] / targets["share"].iloc[0])
        ax = comparisons.plot_reached(trace, tables.runs, shown, palette=palette)
        yield "reached", ax, _caption("reached")
    for value in further_of(tables):
        rows = trace.dropna(subset=value)
        if INDICATORS[value].is_distance and not rows.empty:
            caption = _caption("distances", indicator=INDICATORS[value].label)
            yield value, comparisons.plot_curves(rows, value=value, palette=palette), caption


def rivals(tables: StudyTables) -> tuple[str, str] | None:
    """Return the two algorithms of one mission whose attainment is compared, if there are two.

    They are the two with the largest median areas, or the control and the best of the others.
    """
    ranked = tables.summary.sort_values("area_median", ascending=False, kind="stable")
    labels = sorted(ranked["algorithm"], key=lambda label: label != tables.control)
    return (labels[0], labels[1]) if len(labels) > 1 else None


def write_report(tables: StudyTables, *, workers: int = 1) -> list[Path]:
    """Write the report into the folder ``report`` of a study's folder; return its files.

    They are ``report.html``, ``outcome.tex``, ``summary.tex``, ``comparisons.tex``, ``ranks.tex``,
    and the figures in the folder ``figures``, which ``workers`` processes draw. Files of other
    names stay. No file is replaced before all figures are drawn.
    """
    folder = tables.folder / "report"
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    check_folder(folder / "figures")
    with tempfile.TemporaryDirectory(dir=folder / "figures", prefix=".") as drawn:
        figures = draw_figures(tables, Path(drawn), workers=workers)
        texts = {"report.html": render_page(tables, figures), **tables_latex(tables)}
        files = [path for pictures in figures.values() for paths, _ in pictures for path in paths]
        moved = [path.replace(folder / "figures" / path.name) for path in files]
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [*(folder / name for name in texts), *moved]


def render_page(tables: StudyTables, figures: Mapping[str, Sequence[Figure]]) -> str:
    """Return the report as one HTML page.

    ``figures`` are those of each mission, and under ``""`` those of the study as a whole.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("botohe_moo.study", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    makers = comparison_table, posthoc_table, rank_table, summary_table, target_table
    faults = tables.runs[tables.runs["status"] != "done"]
    told = ["mission", "algorithm", "seed", "status", "stopped_by", "error", "area"]
    page = environment.get_template("report.html.j2").render(
        study=tables,
        figures=figures,
        matrix=matrix(tables),
        caption=matrix_caption(tables),
        missions=mission_table(tables),
        algorithms=algorithm_table(tables),
        environments=ReportTable(tables.environments.set_index("environment").T.reset_index()),
        faults=ReportTable(_headed(faults[told])),
        n_faults=len(faults),
        missing=ReportTable(tables.missing),
        known=INDICATORS,
        **{make.__name__: make for make in makers},
        embedded=lambda path: base64.b64encode(path.read_bytes()).decode(),
        number=itertools.count(1).__next__,
        counted=counted,
        slug=slug,
    )
    return f"{page.strip()}\n"
