"""MkDocs' hooks for the pages of docs/ (mkdocs.yml, tools/docs).

- CONTRIBUTING.md and CHANGELOG.md, which stand beside docs/, are pages, too.
- A link to a file elsewhere in the repository leads to a page that shows it, a link to a public header to Doxygen's.
- A page that the navigation does not have is a warning, and so an error.
"""
import logging
import os
import pathlib
import re
import xml.etree.ElementTree as ElementTree

from mkdocs.structure.files import File
from mkdocs.structure.nav import Link, Section

log = logging.getLogger("mkdocs.plugins.berth")
ROOT = pathlib.Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
BESIDE = ("CONTRIBUTING.md", "CHANGELOG.md")
REFERENCE = "berth-header"  # a scheme, so that MkDocs looks for no page of that name
SHOWN = "sources"  # the folder of the pages that show files
LINK = re.compile(r"\]\(([^)\s#]+)(#[^)\s]*)?\)")
LANGUAGES = {".cpp": "cpp", ".hpp": "cpp", ".h": "c", ".c": "c", ".lua": "lua", ".toml": "toml", ".eds": "ini",
             ".txt": "cmake", ".py": "python", ".md": "markdown", ".json": "json"}
FENCE = "`" * 6


def place_of(src):
    """Where in the repository a page's text is."""
    if src.startswith(SHOWN + "/"):
        return ROOT / src[len(SHOWN) + 1:].removesuffix(".md")
    return ROOT / src if src in BESIDE else DOCS / src


def headers():
    """{path in the repository: page of Doxygen's}, of the public headers."""
    found = {}
    tags = os.environ.get("BERTH_TAGS")
    for compound in ElementTree.parse(tags).getroot().iter("compound") if tags else ():
        if compound.get("kind") == "file":
            found[compound.findtext("path", "") + compound.findtext("name")] = compound.findtext("filename")
    return {path: name if name.endswith(".html") else name + ".html" for path, name in found.items()}


HEADERS = headers()


def page_for(target):
    """The page, as a path in docs/, that stands for this file or folder of the repository."""
    if target.is_relative_to(DOCS):
        return target.relative_to(DOCS).as_posix()
    path = target.relative_to(ROOT).as_posix()
    return path if path in BESIDE else f"{SHOWN}/{path}.md"


def links(src, text):
    """(match, target) of each link of this page to something in the repository that is there."""
    for match in LINK.finditer(text):
        target = (place_of(src).parent / match[1]).resolve()
        if ":" not in match[1] and target.is_relative_to(ROOT) and target.exists():
            yield match, target


def text_of(path):
    """A file or folder of the repository as a page."""
    name = path.relative_to(ROOT).as_posix()
    if path.is_dir():
        inside = sorted(p for p in path.iterdir() if p.suffix in LANGUAGES and p.is_file())
        return f"# {name}\n\n" + "".join(f"- [{p.name}]({path.name}/{p.name})\n" for p in inside)
    if path.suffix == ".md":
        return path.read_text()
    return f"# {name}\n\n{FENCE}{LANGUAGES.get(path.suffix, '')}\n{path.read_text()}{FENCE}\n"


def on_files(files, config):
    def add(src):
        files.append(File(src, str(ROOT / "build" / "none"), config["site_dir"], config["use_directory_urls"]))

    for name in BESIDE:
        add(name)
    waiting = [page.src_path for page in files.documentation_pages()]
    while waiting:
        src = waiting.pop()
        text = text_of(place_of(src)) if src.startswith(SHOWN + "/") else place_of(src).read_text()
        for _, target in links(src, text):
            page = page_for(target)
            if target.relative_to(ROOT).as_posix() in HEADERS or files.get_file_from_path(page) or target == DOCS:
                continue
            add(page)
            waiting.append(page)
    return files


def on_page_read_source(page, config):
    src = page.file.src_path
    return text_of(place_of(src)) if src in BESIDE or src.startswith(SHOWN + "/") else None


def on_page_markdown(markdown, page, config, files):
    src = page.file.src_path
    here = pathlib.PurePosixPath(src).parent
    shift = {}
    for match, target in links(src, markdown):
        header = HEADERS.get(target.relative_to(ROOT).as_posix())
        if header:
            shift[match.span()] = f"]({REFERENCE}:{header})"
        else:
            shift[match.span()] = f"]({os.path.relpath(page_for(target), here)}{match[2] or ''})"
    for (begin, end), text in sorted(shift.items(), reverse=True):
        markdown = markdown[:begin] + text + markdown[end:]
    return markdown


def on_page_content(html, page, config, files):
    up = "../" * (len(pathlib.PurePosixPath(page.file.src_path).parts) - 1)
    return html.replace(f'href="{REFERENCE}:', f'href="{up}cpp/')


def on_nav(nav, config, files):
    for section in nav.items:
        if isinstance(section, Section) and section.title == "Reference":
            link = Link("C++ headers", "cpp/index.html")
            link.parent = section
            section.children.append(link)
    known = {page.file.src_path for page in nav.pages}
    for page in files.documentation_pages():
        if page.src_path not in known and not page.src_path.startswith(SHOWN + "/"):
            log.warning("%s: mkdocs.yml has it not in its navigation", page.src_path)
    return nav
