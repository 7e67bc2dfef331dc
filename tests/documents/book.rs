//! The book builds, and its links resolve.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::sync::OnceLock;

use mdbook_driver::MDBook;

use super::{Document, ROOT, documents, files};

/// The folder of the built book: it stays, to look at.
fn built() -> &'static Path {
    static BOOK: OnceLock<PathBuf> = OnceLock::new();
    BOOK.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("book");
        let mut book = MDBook::load(Path::new(ROOT).join("docs")).unwrap();
        book.config.build.build_dir.clone_from(&folder);
        book.build().unwrap();
        folder
    })
}

/// A relative path without `.` and `..`.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => assert!(normal.pop(), "{} leads out", path.display()),
            Component::CurDir => {}
            other => normal.push(other),
        }
    }
    normal
}

/// The page of the built book for a page's source, relative to `docs/src`.
fn page_of(source: &Path) -> PathBuf {
    built().join(source.with_extension("html"))
}

fn attributes<'a>(html: &'a str, name: &str) -> impl Iterator<Item = &'a str> {
    let opening = format!(" {name}=\"");
    let mut rest = html;
    std::iter::from_fn(move || {
        let start = rest.find(&opening)? + opening.len();
        let end = start + rest[start..].find('"')?;
        let value = &rest[start..end];
        rest = &rest[end..];
        Some(value)
    })
}

fn is_external(link: &str) -> bool {
    link.contains("://") || link.starts_with("mailto:") || link.starts_with("data:")
}

#[test]
fn every_page_is_in_the_summary_once() {
    let summary = Document::read("docs/src/SUMMARY.md");
    let mut listed: Vec<_> = links(&summary.text)
        .map(|link| format!("docs/src/{link}"))
        .collect();
    listed.sort();
    let pages = files("docs/src", "md");
    let pages: Vec<_> = (pages.into_iter())
        .filter(|page| page != "docs/src/SUMMARY.md")
        .collect();
    assert_eq!(listed, pages);
}

#[test]
fn links_and_anchors_of_the_book_resolve() {
    for source in files("docs/src", "md") {
        let source = Path::new(&source).strip_prefix("docs/src").unwrap();
        if source == Path::new("SUMMARY.md") {
            continue;
        }
        let page = page_of(source);
        let html = fs::read_to_string(&page).unwrap();
        for link in attributes(&html, "href").chain(attributes(&html, "src")) {
            if is_external(link) {
                continue;
            }
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let folder = source.parent().unwrap();
            let target = match path {
                "" => page.clone(),
                path => built().join(normal(&folder.join(path))),
            };
            assert!(
                target.exists(),
                "docs/src/{}: dead link {link}",
                source.display()
            );
            assert_has_anchor(&target, anchor, &format!("docs/src/{}", source.display()));
        }
    }
}

fn assert_has_anchor(page: &Path, anchor: &str, source: &str) {
    if anchor.is_empty() || page.extension().is_none_or(|it| it != "html") {
        return;
    }
    let html = fs::read_to_string(page).unwrap();
    let ids: BTreeSet<_> = attributes(&html, "id").collect();
    let page = page.display();
    assert!(
        ids.contains(anchor),
        "{source}: {page} has no anchor #{anchor}"
    );
}

/// The targets of a document's links.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](")
        .skip(1)
        .map(|rest| rest.split(')').next().unwrap())
}

#[test]
fn links_between_documents_resolve() {
    for document in documents() {
        let folder = Path::new(&document.path).parent().unwrap();
        for link in links(&document.prose()).filter(|link| !is_external(link)) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = match path {
                "" => PathBuf::from(&document.path),
                path => normal(&folder.join(path)),
            };
            let exists = Path::new(ROOT).join(&target).exists();
            assert!(exists, "{}: dead link {link}", document.path);
            if let Ok(source) = target.strip_prefix("docs/src") {
                assert_has_anchor(&page_of(source), anchor, &document.path);
            }
        }
    }
}

/// Files in backticks: paths from the root, or the last part of one.
#[test]
fn source_files_that_documents_name_exist() {
    let sources = files("", "rs");
    let mut missing = Vec::new();
    for document in documents() {
        // The changelog and decisions may name what is gone.
        if document.path == "CHANGELOG.md" || document.path.contains("/decisions/") {
            continue;
        }
        let prose = document.prose();
        for name in prose.split('`').skip(1).step_by(2) {
            let is_path = name
                .chars()
                .all(|c| c.is_alphanumeric() || "/._-".contains(c));
            let exists = match name.strip_suffix('/') {
                Some(folder) if is_path && folder.contains('/') && !folder.starts_with("runs/") => {
                    Path::new(ROOT).join(folder).is_dir()
                }
                _ if is_path && name.ends_with(".rs") => {
                    (sources.iter()).any(|it| it == name || it.ends_with(&format!("/{name}")))
                }
                _ => true,
            };
            if !exists {
                missing.push(format!("{} names {name}", document.path));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

/// Names in code style of pages about the code: identifiers, also with a path, as in `World::next`.
#[test]
fn names_of_code_in_documents_exist() {
    let mut known = BTreeSet::new();
    for file in files("", "rs").into_iter().chain(files("", "toml")) {
        let text = fs::read_to_string(Path::new(ROOT).join(file)).unwrap();
        let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
        known.extend(words.map(str::to_owned));
    }
    let mut unknown = Vec::new();
    for document in documents() {
        let is_about_code = ["docs/src/how/", "docs/src/extend/"]
            .iter()
            .any(|it| document.path.starts_with(it));
        if !is_about_code {
            continue;
        }
        let prose = document.prose();
        for name in prose.split('`').skip(1).step_by(2) {
            let mut words = name.split("::");
            let is_name = |word: &str| word.chars().all(|c| c.is_alphanumeric() || c == '_');
            if words.clone().all(is_name) && !words.all(|word| known.contains(word)) {
                unknown.push(format!("{} names {name}", document.path));
            }
        }
    }
    assert!(unknown.is_empty(), "{unknown:#?}");
}
