//! Frames that rest on a checkpoint that does not last yet.

use std::collections::VecDeque;

use muster_runtime::journal::Written;

/// How many wait at the most; of more the oldest are left out, which the others have missed for long anyway.
const WAITING_MAX: usize = 1_024;

/// What waits for the journal, in the order in which it was to be done.
#[derive(Debug)]
pub(super) struct Resting<T> {
    /// The newest checkpoint that must last.
    newest: u64,
    /// The newest that does.
    lasting: u64,
    waiting: VecDeque<(u64, T)>,
}

impl<T> Default for Resting<T> {
    fn default() -> Self {
        Self {
            newest: 0,
            lasting: 0,
            waiting: VecDeque::new(),
        }
    }
}

impl<T> Resting<T> {
    /// What comes from now on rests on the checkpoint of this number.
    pub(super) const fn rests_on(&mut self, number: u64) {
        self.newest = number;
    }

    /// Takes something; it is handed back if all that it rests on lasts.
    pub(super) fn take(&mut self, it: T) -> Option<T> {
        if self.newest <= self.lasting {
            return Some(it);
        }
        if self.waiting.len() == WAITING_MAX {
            self.waiting.pop_front();
        }
        self.waiting.push_back((self.newest, it));
        None
    }

    /// What may be done now that this has become of checkpoints, in order. What rests on one that could not be written is
    /// left out.
    pub(super) fn written(&mut self, written: &Written) -> Vec<T> {
        match written {
            Written::UpTo(number) => {
                self.lasting = self.lasting.max(*number);
                let may_go = self.waiting.iter();
                let may_go = may_go.take_while(|(on, _)| on <= number).count();
                self.waiting.drain(..may_go).map(|(_, it)| it).collect()
            }
            Written::Failed { number, .. } => {
                self.lasting = self.lasting.max(*number);
                self.waiting.retain(|(on, _)| on > number);
                Vec::new()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io;

    use super::*;

    fn resting() -> Resting<char> {
        let mut resting = Resting::default();
        assert_eq!(resting.take('a'), Some('a'));
        resting.rests_on(1);
        assert_eq!(resting.take('b'), None);
        resting.rests_on(3);
        assert_eq!(resting.take('c'), None);
        assert_eq!(resting.take('d'), None);
        resting
    }

    #[test]
    fn a_frame_waits_for_what_it_rests_on_and_for_nothing_else() {
        let mut resting = resting();
        assert_eq!(resting.written(&Written::UpTo(2)), ['b']);
        assert_eq!(resting.take('e'), None);
        assert_eq!(resting.written(&Written::UpTo(4)), ['c', 'd', 'e']);
        assert_eq!(resting.take('f'), Some('f'));
    }

    #[test]
    fn what_rests_on_what_could_not_be_written_is_not_said() {
        let failed = |number| Written::Failed {
            number,
            error: io::Error::other("the disk is full"),
        };
        let mut resting = resting();
        assert!(resting.written(&failed(1)).is_empty());
        assert!(resting.written(&failed(3)).is_empty());
        assert_eq!(resting.take('e'), Some('e'));
    }

    #[test]
    fn no_more_waits_than_there_is_room_for() {
        let mut resting = Resting::default();
        resting.rests_on(1);
        (0..=WAITING_MAX).for_each(|it| assert_eq!(resting.take(it), None));
        let may_go = resting.written(&Written::UpTo(1));
        assert_eq!((may_go.len(), may_go[0]), (WAITING_MAX, 1));
    }
}
