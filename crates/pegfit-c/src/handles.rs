//! Numbers that stand for shared things, and never for a thing that is gone.

use std::sync::{Arc, PoisonError, RwLock};

/// Things by handle. A handle is the place in the list, counted from 1, in its lower half and the
/// place's generation in its upper half; the generation changes when the thing goes.
#[derive(Debug)]
pub(crate) struct Handles<T> {
    slots: RwLock<Vec<Slot<T>>>,
}

#[derive(Debug)]
struct Slot<T> {
    generation: u32,
    thing: Option<Arc<T>>,
}

impl<T> Handles<T> {
    pub(crate) const fn new() -> Self {
        Self {
            slots: RwLock::new(Vec::new()),
        }
    }

    /// Keeps `thing`; `None` if four thousand million places are in use.
    pub(crate) fn insert(&self, thing: T) -> Option<u64> {
        // No code between lock and unlock can panic halfway through a change.
        let mut slots = self.slots.write().unwrap_or_else(PoisonError::into_inner);
        // A place whose generations are used up stays empty for ever.
        let free = slots
            .iter()
            .position(|s| s.thing.is_none() && s.generation < u32::MAX);
        let place = free.unwrap_or(slots.len());
        let number = u32::try_from(place + 1).ok()?;
        if free.is_none() {
            slots.push(Slot {
                generation: 0,
                thing: None,
            });
        }
        let slot = &mut slots[place];
        slot.thing = Some(Arc::new(thing));
        Some(u64::from(slot.generation) << 32 | u64::from(number))
    }

    /// The thing, kept alive while it is used.
    pub(crate) fn get(&self, handle: u64) -> Option<Arc<T>> {
        let slots = self.slots.read().unwrap_or_else(PoisonError::into_inner);
        let slot = slots.get(place(handle)?)?;
        (slot.generation == generation(handle))
            .then(|| slot.thing.clone())
            .flatten()
    }

    /// Gives the thing up; `None` if there is none.
    pub(crate) fn remove(&self, handle: u64) -> Option<Arc<T>> {
        let mut slots = self.slots.write().unwrap_or_else(PoisonError::into_inner);
        let slot = slots.get_mut(place(handle)?)?;
        if slot.generation != generation(handle) {
            return None;
        }
        let thing = slot.thing.take()?;
        slot.generation += 1;
        Some(thing)
    }
}

fn place(handle: u64) -> Option<usize> {
    (handle as u32 as usize).checked_sub(1)
}

fn generation(handle: u64) -> u32 {
    (handle >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_handle_names_one_thing_for_ever() {
        let handles = Handles::new();
        let first = handles.insert("a").unwrap();
        let second = handles.insert("b").unwrap();
        assert!(first != 0 && first != second);
        assert_eq!(handles.get(first).as_deref(), Some(&"a"));
        assert!(handles.remove(first).is_some());
        let third = handles.insert("c").unwrap();
        for stale in [first, 0, u64::MAX, third + 7, third | 1 << 63] {
            assert!(handles.get(stale).is_none(), "{stale:#x}");
            assert!(handles.remove(stale).is_none(), "{stale:#x}");
        }
        assert_eq!(handles.get(third).as_deref(), Some(&"c"));
        assert_eq!(handles.get(second).as_deref(), Some(&"b"));
    }

    #[test]
    fn a_place_whose_generations_are_used_up_is_left_alone() {
        let handles = Handles::new();
        let first = handles.insert(1).unwrap();
        handles.slots.write().unwrap()[0].generation = u32::MAX - 1;
        let last = first | u64::from(u32::MAX - 1) << 32;
        assert!(handles.remove(last).is_some());
        assert_eq!(handles.insert(2).unwrap() as u32, 2);
    }
}
