//! Documents are correct: examples run, links resolve, and generated pages are up to date.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod book;
mod examples;
#[path = "../../docs/links.rs"]
mod links;
mod pages;
mod results;

use std::fs;
use std::path::{Path, PathBuf};

use self::links::OUTSIDE;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A document: its path, relative to the repository's root, and its text.
struct Document {
    path: String,
    text: String,
}

/// A fenced block of code: the line that it starts at, its info string and its text.
struct Block {
    line: usize,
    info: String,
    text: String,
}

impl Document {
    fn read(path: &str) -> Self {
        let text = fs::read_to_string(Path::new(ROOT).join(path));
        Self {
            path: path.to_owned(),
            text: text.unwrap_or_else(|error| panic!("{path}: {error}")),
        }
    }

    fn blocks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        let mut open: Option<Block> = None;
        for (index, line) in self.text.lines().enumerate() {
            match (line.trim_start().strip_prefix("```"), open.as_mut()) {
                (Some(info), None) => {
                    open = Some(Block {
                        line: index + 1,
                        info: info.to_owned(),
                        text: String::new(),
                    });
                }
                (Some(_), Some(_)) => blocks.extend(open.take()),
                (None, Some(block)) => {
                    block.text.push_str(line);
                    block.text.push('\n');
                }
                (None, None) => {}
            }
        }
        assert!(open.is_none(), "{}: a block is not closed", self.path);
        blocks
    }

    /// The text without its blocks of code.
    fn prose(&self) -> String {
        let mut inside = false;
        let lines = self.text.lines().filter(|line| {
            let is_fence = line.trim_start().starts_with("```");
            inside ^= is_fence;
            !inside && !is_fence
        });
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// All documents, those outside the book first, then the book's pages in the order of their paths.
fn documents() -> Vec<Document> {
    let mut paths: Vec<String> = OUTSIDE.map(str::to_owned).into();
    paths.extend(files("docs/src", "md"));
    paths.iter().map(|path| Document::read(path)).collect()
}

/// The files in a folder and its subfolders whose names end in `.extension`, sorted, relative to the root.
fn files(folder: &str, extension: &str) -> Vec<String> {
    fn visit(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap();
            if path.is_dir() {
                if name != "target" && name != "runs" && !name.starts_with('.') {
                    visit(&path, extension, found);
                }
            } else if path.extension().is_some_and(|it| it == extension) {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    visit(&Path::new(ROOT).join(folder), extension, &mut found);
    let relative = |path: &PathBuf| {
        let path = path.strip_prefix(ROOT).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let mut found: Vec<_> = found.iter().map(relative).collect();
    found.sort();
    found
}

/// Compares a generated page with the file, or writes it if `INSTA_UPDATE` is `always`.
fn assert_generated(path: &str, page: &str) {
    let file = Path::new(ROOT).join(path);
    if std::env::var("INSTA_UPDATE").is_ok_and(|it| it == "always") {
        fs::write(&file, page).unwrap();
        return;
    }
    let kept = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        kept == page,
        "{path} is out of date: run `INSTA_UPDATE=always cargo test --test documents`"
    );
}
