//! A mission's items in order of the flight, with jumps resolved.

use super::ITEMS_MAX;
use super::command::Manoeuvre;
use super::document::Document;
use super::item::Item;
use crate::diagnostic::BadInput;

/// A mission's items, including jumps.
pub(super) struct Jumps<'a> {
    pub(super) document: Document<'a>,
    pub(super) items: &'a [Item<'a>],
}

/// A parsed jump.
struct Jump {
    /// Index of the target among the items.
    to: usize,
    /// Repetitions. `None`: endless.
    times: Option<usize>,
}

impl<'a> Jumps<'a> {
    /// The items in order of the flight. Jumps are replaced by their repetitions, except endless jumps back and jumps after the
    /// return to launch, which are kept as items.
    pub(super) fn in_flight_order(&self) -> Result<Vec<&'a Item<'a>>, BadInput> {
        let mut flown = Vec::new();
        let mut left = vec![None; self.items.len()];
        let mut has_returned = false;
        let mut jumps = 0;
        let mut at = 0;
        while let Some(item) = self.items.get(at) {
            has_returned |= item.is_flown_as(Manoeuvre::ReturnToLaunch);
            let jump = if item.is_flown_as(Manoeuvre::Jump) && !has_returned {
                Some(self.jump_from(at)?)
            } else {
                None
            };
            let next = match jump {
                Some(Jump {
                    to,
                    times: Some(times),
                }) => {
                    let left = left[at].get_or_insert(times);
                    let next = if *left > 0 { to } else { at + 1 };
                    *left = left.saturating_sub(1);
                    Some(next)
                }
                Some(Jump { to, times: None }) if to > at => Some(to),
                _ => None,
            };
            let count = if next.is_some() { jumps } else { flown.len() };
            if count == ITEMS_MAX {
                return Err(self.document.refuse(
                    item.command.text,
                    format_args!(
                        "the mission has more than {ITEMS_MAX} items with its jumps repeated"
                    ),
                    "give fewer repetitions",
                ));
            }
            match next {
                Some(next) => {
                    jumps += 1;
                    at = next;
                }
                None => {
                    flown.push(item);
                    at += 1;
                }
            }
        }
        Ok(flown)
    }

    /// Parses a jump. One past the return to launch is refused, for the mission ends there.
    fn jump_from(&self, at: usize) -> Result<Jump, BadInput> {
        let item = &self.items[at];
        let jump = self.jump(item)?;
        let passed = self.items.get(at..jump.to).unwrap_or_default();
        let end = passed
            .iter()
            .find(|item| item.is_flown_as(Manoeuvre::ReturnToLaunch));
        match end {
            Some(end) if jump.times != Some(0) => Err(self.document.refuse(
                item.first.text,
                format_args!(
                    "{}: the jump passes {}, where the mission ends",
                    item.name, end.name
                ),
                "put the return to launch last, or jump to an item before it",
            )),
            _ => Ok(jump),
        }
    }

    fn jump(&self, item: &Item<'_>) -> Result<Jump, BadInput> {
        let number = item.first.value;
        let is_named = |it: &Item<'_>| it.number.is_some() && it.number.map(f64::from) == number;
        let Some(to) = self.items.iter().position(is_named) else {
            return Err(self.document.refuse(
                item.first.text,
                format_args!("{}: the jump's target does not exist", item.name),
                "give the number of an item, counted from 1 as in the ground station",
            ));
        };
        match item.second.value {
            Some(times) if times < 0.0 => Ok(Jump { to, times: None }),
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a whole number up to `ITEMS_MAX`"
            )]
            Some(times) if times.fract() == 0.0 && times <= ITEMS_MAX as f64 => Ok(Jump {
                to,
                times: Some(times as usize),
            }),
            _ => Err(self.document.refuse(
                item.second.text,
                format_args!("{}: the jump's number of repetitions is invalid", item.name),
                format!("give a whole number from 0 to {ITEMS_MAX}"),
            )),
        }
    }
}
