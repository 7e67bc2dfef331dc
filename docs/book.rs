//! Builds the book into `target/book`, and checks the links and anchors of its pages and of the documents outside it.
//! Prints what is wrong, and exits with 1 if anything is.

mod links;

use std::collections::BTreeSet;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use mdbook_driver::MDBook;

use links::{OUTSIDE, is_external, links, normal};

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = docs.parent().ok_or("the book's folder has no parent")?;
    let built = root.join("target/book");
    let mut book = MDBook::load(docs)?;
    book.config.build.build_dir.clone_from(&built);
    book.build()?;
    let mut dead = Vec::new();
    for page in pages(&docs.join("src"))? {
        let page = page.strip_prefix(docs.join("src"))?;
        if page == Path::new("SUMMARY.md") {
            continue;
        }
        let html = built.join(page.with_extension("html"));
        let text = fs::read_to_string(&html)
            .map_err(|error| format!("docs/src/{}: {error}", page.display()))?;
        for link in attributes(&text, "href").chain(attributes(&text, "src")) {
            if !resolves(&html, link) {
                dead.push(format!("docs/src/{}: dead link {link}", page.display()));
            }
        }
    }
    for document in OUTSIDE {
        let text = fs::read_to_string(root.join(document))?;
        for link in links(&text) {
            if !resolves_into_book(root, &built, document, link) {
                dead.push(format!("{document}: dead link {link}"));
            }
        }
    }
    for line in &dead {
        println!("{line}");
    }
    println!(
        "{} dead links; the book is target/book/index.html",
        dead.len()
    );
    Ok(if dead.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// The Markdown files in a folder and its subfolders.
fn pages(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(pages(&path)?);
        } else if path.extension().is_some_and(|it| it == "md") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// The values of an attribute in a page.
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

/// Whether a link of a built page leads to a file and an anchor that exist, or elsewhere.
fn resolves(page: &Path, link: &str) -> bool {
    let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
    let target = match page.parent() {
        Some(folder) if !path.is_empty() => normal(&folder.join(path)),
        _ => page.to_owned(),
    };
    is_external(link) || target.exists() && has_anchor(&target, anchor)
}

fn has_anchor(page: &Path, anchor: &str) -> bool {
    if anchor.is_empty() || page.extension().is_none_or(|it| it != "html") {
        return true;
    }
    let html = fs::read_to_string(page).unwrap_or_default();
    let ids: BTreeSet<_> = attributes(&html, "id").collect();
    ids.contains(anchor)
}

/// Whether a link of a document outside the book leads to a page and an anchor of the book that exist, or elsewhere.
fn resolves_into_book(root: &Path, built: &Path, document: &str, link: &str) -> bool {
    let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
    let folder = Path::new(document).parent().unwrap_or(Path::new(""));
    let target = normal(&folder.join(path));
    let source = target.strip_prefix("docs/src");
    let Some(source) = source
        .ok()
        .filter(|it| it.extension().is_some_and(|it| it == "md"))
    else {
        return true;
    };
    let page = built.join(source.with_extension("html"));
    root.join(&target).exists() && has_anchor(&page, anchor)
}
