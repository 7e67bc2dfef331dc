//! What is kept of several drones, found by their ids.

use smallvec::SmallVec;

use crate::identity::NodeId;

/// Entries in the order of their drones' ids. The ids lie together, apart from the entries, so that one is found without
/// a look at the others.
#[derive(Debug, Clone)]
pub(crate) struct Roster<T> {
    ids: SmallVec<[NodeId; 8]>,
    entries: Vec<T>,
}

/// As long as there are no more, they are counted through side by side sooner than they are halved again and again.
const FEW: usize = 16;

impl<T> Default for Roster<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T> Roster<T> {
    /// With room for as many entries as there is for ids, beside whatever is built with it.
    pub(crate) fn new() -> Self {
        let ids = SmallVec::new();
        Self {
            entries: Vec::with_capacity(ids.inline_size()),
            ids,
        }
    }

    pub(crate) const fn len(&self) -> usize {
        self.entries.len()
    }

    /// Where a drone's entry is, or would be.
    #[inline]
    pub(crate) fn find(&self, id: NodeId) -> Result<usize, usize> {
        if self.ids.len() > FEW {
            return self.ids.binary_search(&id);
        }
        // As wide as an id, so that none has to be widened.
        let before: u32 = self.ids.iter().map(|other| u32::from(*other < id)).sum();
        let place = before as usize;
        if self.ids.get(place) == Some(&id) {
            Ok(place)
        } else {
            Err(place)
        }
    }

    /// The entry at a place where [`Self::find`] found one.
    #[inline]
    pub(crate) fn at(&mut self, place: usize) -> &mut T {
        &mut self.entries[place]
    }

    #[inline]
    pub(crate) fn get(&self, id: NodeId) -> Option<&T> {
        let place = self.find(id).ok()?;
        self.entries.get(place)
    }

    #[inline]
    pub(crate) fn get_mut(&mut self, id: NodeId) -> Option<&mut T> {
        let place = self.find(id).ok()?;
        self.entries.get_mut(place)
    }

    /// Puts an entry where [`Self::find`] found none.
    pub(crate) fn insert(&mut self, place: usize, id: NodeId, entry: T) {
        self.ids.insert(place, id);
        self.entries.insert(place, entry);
    }

    /// Takes a drone's entry out, if there is one; whether there was.
    pub(crate) fn remove(&mut self, id: NodeId) -> bool {
        let place = self.find(id);
        if let Ok(place) = place {
            self.ids.remove(place);
            self.entries.remove(place);
        }
        place.is_ok()
    }

    /// Takes out whatever is not to be kept.
    pub(crate) fn retain(&mut self, keep: impl Fn(&T) -> bool) {
        let mut entries = self.entries.iter();
        self.ids.retain(|_| entries.next().is_some_and(&keep));
        self.entries.retain(keep);
    }

    /// All of them, the lowest id first.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &T> {
        self.entries.iter()
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.entries.iter_mut()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_found_under_their_ids_whatever_came_or_went_before() {
        let mut roster = Roster::new();
        for id in [7, 3, 20, 9, 1, 15, 2, 11, 30, 4].into_iter().chain(50..60) {
            let place = roster.find(NodeId(id)).unwrap_err();
            roster.insert(place, NodeId(id), id);
        }
        assert!((50..60).all(|id| roster.remove(NodeId(id))));
        assert!(roster.remove(NodeId(9)) && !roster.remove(NodeId(9)));
        roster.retain(|entry| entry % 5 > 0);
        assert!(roster.iter().eq(&[1, 2, 3, 4, 7, 11]));
        *roster.get_mut(NodeId(11)).unwrap() = 0;
        assert_eq!(roster.get(NodeId(11)), Some(&0));
        assert_eq!(roster.get(NodeId(20)), None);
    }
}
