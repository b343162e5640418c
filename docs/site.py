"""Collects the pages of the site.

Every document keeps its place in the repository, so that its links lead to the same files; the reference of each public
package is a page of its docstrings.
"""

from __future__ import annotations

from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "*.md",
    "docs/*.md",
    "benchmarks/*.md",
    "benchmarks/bundle/model_card.md",
    "evaluation/README.md",
    "stages/README.md",
    "deploy/README.md",
    "deploy/client/*/README.md",
    "deploy/retrain/README.md",
)
LINKED = (
    "LICENSE",
    "docs/*.json",
    "docs/*.ipynb",
    "docs/*.png",
    "benchmarks/**/*.svg",
    "benchmarks/**/*.png",
    "deploy/nginx/diaphane.conf",
    "deploy/k8s/*.yaml",
)

PACKAGES = {
    "diaphane": ROOT,
    "labeller": ROOT,
    "renderer": ROOT,
    "trainer": ROOT,
    "schemas": ROOT,
    "diaphane_client": ROOT / "deploy" / "client" / "python",
}
"""What is meant to be imported -> where it is. `services` is an application: its interface is the command line."""


INSIDE = {"account", "cli", "client", "gate", "local", "samples", "usd"}
"""Folders of packages that serve the package alone: they are left out."""


def reference(package: str, folder: Path) -> str:
    """The page of a package: its modules with what they define, Markdown.

    Args:
        package: Its name.
        folder: Where it is.
    """
    paths = (path.relative_to(folder) for path in (folder / package).rglob("*.py"))
    modules = sorted(".".join(path.with_suffix("").parts) for path in paths if INSIDE.isdisjoint(path.parts))
    names = [name.removesuffix(".__init__") for name in modules if not name.endswith("__main__")]
    return "\n\n".join([f"# `{package}`", *(f"::: {name}" for name in names)])


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The documents of the repository, by their path in it, in place of those of one folder.

    Args:
        files: What was found in `docs/`.
        config: Of the site.
    """
    theme = [file for file in files if file.src_uri.startswith("assets/")]
    paths = sorted({path for pattern in (*PAGES, *LINKED) for path in ROOT.glob(pattern)})
    own = [File.generated(config, path.relative_to(ROOT).as_posix(), abs_src_path=str(path)) for path in paths]
    pages = [
        File.generated(config, f"reference/{package}.md", content=reference(package, folder))
        for package, folder in PACKAGES.items()
    ]
    return Files([*theme, *own, *pages])
