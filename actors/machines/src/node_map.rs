//! A map from drones to entries, optimised for look-ups among a few to some hundred.

use smallvec::SmallVec;

use crate::identity::NodeId;

/// Entries in the order of their ids. The ids lie together, apart from the entries, so a look-up does not load the
/// entries.
#[derive(Debug, Clone)]
pub(crate) struct NodeMap<T> {
    ids: SmallVec<[NodeId; 8]>,
    entries: Vec<T>,
}

/// Up to this many entries a linear count is faster than a binary search.
const LINEAR_SEARCH_MAX: usize = 16;

impl<T> Default for NodeMap<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T> NodeMap<T> {
    /// Reserves room for as many entries as ids fit inline.
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

    /// Index of a drone's entry: `Ok` if it exists, `Err` with the place to insert it.
    #[inline]
    pub(crate) fn find(&self, id: NodeId) -> Result<usize, usize> {
        if self.ids.len() > LINEAR_SEARCH_MAX {
            return self.ids.binary_search(&id);
        }
        // As wide as an id, so that the loop vectorises without conversions.
        let before: u32 = self.ids.iter().map(|other| u32::from(*other < id)).sum();
        let place = before as usize;
        if self.ids.get(place) == Some(&id) {
            Ok(place)
        } else {
            Err(place)
        }
    }

    /// As [`Self::find`], and quicker if the entry is at `guess`.
    #[inline]
    pub(crate) fn find_near(&self, guess: usize, id: NodeId) -> Result<usize, usize> {
        if self.ids.get(guess) == Some(&id) {
            return Ok(guess);
        }
        self.find(id)
    }

    /// The entry at an index that [`Self::find`] found.
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

    /// Inserts an entry at the index that [`Self::find`] returned as `Err`.
    pub(crate) fn insert(&mut self, place: usize, id: NodeId, entry: T) {
        self.ids.insert(place, id);
        self.entries.insert(place, entry);
    }

    /// Removes a drone's entry; returns whether there was one.
    pub(crate) fn remove(&mut self, id: NodeId) -> bool {
        let place = self.find(id);
        if let Ok(place) = place {
            self.ids.remove(place);
            self.entries.remove(place);
        }
        place.is_ok()
    }

    /// Removes the entries for which `keep` is false.
    pub(crate) fn retain(&mut self, keep: impl Fn(&T) -> bool) {
        let mut entries = self.entries.iter();
        self.ids.retain(|_| entries.next().is_some_and(&keep));
        self.entries.retain(keep);
    }

    /// Entries, lowest id first.
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
    fn entries_are_found_after_inserts_and_removals() {
        let mut map = NodeMap::new();
        for id in [7, 3, 20, 9, 1, 15, 2, 11, 30, 4].into_iter().chain(50..60) {
            let place = map.find(NodeId(id)).unwrap_err();
            map.insert(place, NodeId(id), id);
        }
        assert!((50..60).all(|id| map.remove(NodeId(id))));
        assert!(map.remove(NodeId(9)) && !map.remove(NodeId(9)));
        map.retain(|entry| entry % 5 > 0);
        assert!(map.iter().eq(&[1, 2, 3, 4, 7, 11]));
        *map.get_mut(NodeId(11)).unwrap() = 0;
        assert_eq!(map.get(NodeId(11)), Some(&0));
        assert_eq!(map.get(NodeId(20)), None);
        for guess in 0..9 {
            assert_eq!(map.find_near(guess, NodeId(3)), Ok(2));
            assert_eq!(map.find_near(guess, NodeId(5)), Err(4));
        }
    }
}
