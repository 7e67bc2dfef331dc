//! Tokens of a line, and what is wrong with them.

use crate::refusal::Refusal;

/// The rest of a line of a text.
#[derive(Clone, Copy)]
pub(super) struct Tokens<'a> {
    text: &'a str,
    rest: &'a str,
}

impl<'a> Tokens<'a> {
    /// The words of `line`, which is part of `text`.
    pub(super) fn new(text: &'a str, line: &'a str) -> Self {
        Self { text, rest: line }
    }

    pub(super) fn next(&mut self) -> Option<&'a str> {
        let start = self.rest.trim_start();
        let end = start.find(char::is_whitespace).unwrap_or(start.len());
        let (word, rest) = start.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    pub(super) fn number(&mut self, what: &str, range: (f64, f64)) -> Result<f64, Refusal> {
        let (min, max) = range;
        let accepted = format!("{what} is a number from {min} to {max}");
        let Some(word) = self.next() else {
            return Err(self.refuse(self.rest, &format!("{what} is missing"), &accepted));
        };
        match word.parse::<f64>() {
            Ok(number) if number >= min && number <= max => Ok(number),
            _ => Err(self.refuse(word, &format!("{what} can't be {word:?}"), &accepted)),
        }
    }

    /// A whole number.
    pub(super) fn count(
        &mut self,
        what: &str,
        (min, max): (usize, usize),
    ) -> Result<usize, Refusal> {
        let word = Self { ..*self }.next().unwrap_or(self.rest);
        let number = self.number(what, (min as f64, max as f64))?;
        if libm::trunc(number) < number {
            return Err(self.refuse(
                word,
                &format!("{what} is no whole number"),
                "a whole number",
            ));
        }
        Ok(number as usize)
    }

    /// Whether the next word is one of these; then it is taken.
    pub(super) fn take(&mut self, accepted: &[&str]) -> bool {
        let mut ahead = *self;
        let is_next = ahead.next().is_some_and(|word| accepted.contains(&word));
        if is_next {
            *self = ahead;
        }
        is_next
    }

    pub(super) fn refuse(&self, word: &str, message: &str, accepted: &str) -> Refusal {
        let start = word.as_ptr() as usize - self.text.as_ptr() as usize;
        Refusal::new(start..start + word.len(), message, accepted)
    }
}
