//! Links between documents resolve, and what they name exists. `docs/book.rs` builds the book and checks its anchors.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use super::links::{is_external, links, normal};
use super::{Document, ROOT, documents, files};

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
fn links_between_documents_resolve() {
    for document in documents() {
        let folder = Path::new(&document.path).parent().unwrap();
        for link in links(&document.prose()).filter(|link| !is_external(link)) {
            let path = link.split('#').next().unwrap();
            let target = Path::new(ROOT).join(normal(&folder.join(path)));
            let exists = path.is_empty() || target.exists();
            assert!(exists, "{}: dead link {link}", document.path);
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
