//! Where a plan drawn as text stands in its file, for errors.

use std::ops::Range;

/// The place of a plan in a file's text.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Place {
    /// The whole plan, in bytes.
    span: Range<usize>,
    /// Where each line of the plan begins, in bytes. Empty if the plan does not stand in the text as it is.
    lines: Vec<usize>,
}

/// Lines of a file before the plan's first one: that with the plan's name, at most one more.
const LINES_BEFORE_MAX: usize = 2;

impl Place {
    /// The place of a plan that is the whole text.
    pub(super) fn of_all(plan: &str) -> Self {
        Self::after(plan, 0, (plan, 0..plan.len()))
    }

    /// The place of a plan that stands in a text, each line after spaces, on the line of the byte `key` or on those below.
    /// `span` is where a reader of the text saw it.
    pub(super) fn after(text: &str, key: usize, (plan, span): (&str, Range<usize>)) -> Self {
        let mut next = text[..key].rfind('\n').map_or(0, |it| it + 1);
        let lines = text[next..].split_inclusive('\n').map(|line| {
            let start = next;
            next += line.len();
            (start, line.trim_end())
        });
        let lines: Vec<(usize, &str)> = lines.collect();
        let from = |before: usize| {
            let mut lines = lines.iter().skip(before);
            let starts = plan.lines().map(|drawn| start(*lines.next()?, drawn));
            starts.collect::<Option<Vec<usize>>>()
        };
        let lines = (0..=LINES_BEFORE_MAX).find_map(from).unwrap_or_default();
        Self { span, lines }
    }

    /// The whole plan, in bytes of the text.
    pub(super) fn whole(&self) -> Range<usize> {
        self.span.clone()
    }

    /// A part of a line of the plan, in bytes of the text; the whole plan if its lines are not known.
    pub(super) fn of(&self, line: usize, part: Range<usize>) -> Range<usize> {
        match self.lines.get(line) {
            Some(start) => start + part.start..start + part.end,
            None => self.whole(),
        }
    }
}

/// Where a line of a plan begins, if a line of the text is that line after spaces and quotation marks.
fn start((at, line): (usize, &str), drawn: &str) -> Option<usize> {
    let before = line.strip_suffix(drawn.trim_end())?;
    let is_space = |it: char| it.is_whitespace() || matches!(it, '\'' | '"');
    before.chars().all(is_space).then_some(at + before.len())
}
