//! A queue for searches whose priorities never fall below the one taken last: equal buckets, taken in order.
//!
//! Within a bucket the last entry comes first, so a search that uses it must be ready to find a cheaper way to a
//! place that it has left already.

const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Entry {
    item: u32,
    next: u32,
}

/// A monotone bucket queue (Dial 1969) over a ring of buckets.
#[derive(Clone, Debug)]
pub(super) struct Buckets {
    /// Last entry of each bucket.
    heads: Vec<u32>,
    /// All entries, linked within their buckets and, once taken, as free places.
    entries: Vec<Entry>,
    free: u32,
    /// The last entry of the current bucket, which comes next: it needs no link.
    held: u32,
    /// Width of a bucket, as a power of two.
    width_bits: u32,
    /// Number of the bucket that is being emptied.
    current: u64,
    len: usize,
}

impl Buckets {
    /// Makes an empty queue. No two priorities in it at a time may differ by more than `span`, and none may be lower
    /// than that of the entry taken last; buckets are as wide as `width` or, for a large span, wider.
    pub(super) fn new(span: u64, width: u64) -> Buckets {
        let mut width_bits = width.max(1).ilog2();
        while span >> width_bits > 4096 {
            width_bits += 1;
        }
        // Two more: neither the bucket of the entry taken nor that of the priority is filled exactly.
        let buckets = ((span >> width_bits) + 2).next_power_of_two() as usize;
        let entries = Vec::with_capacity(1024);
        Buckets {
            heads: vec![NONE; buckets],
            entries,
            free: NONE,
            held: NONE,
            width_bits,
            current: 0,
            len: 0,
        }
    }

    /// Returns whether nothing is in it.
    pub(super) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Adds an entry; its item is less than the largest number.
    #[inline]
    pub(super) fn push(&mut self, priority: u64, item: u32) {
        let bucket = priority >> self.width_bits;
        self.len += 1;
        if bucket == self.current {
            let before = std::mem::replace(&mut self.held, item);
            if before != NONE {
                self.link(bucket, before);
            }
            return;
        }
        if self.len == 1 || bucket < self.current {
            let before = std::mem::replace(&mut self.held, NONE);
            if before != NONE {
                self.link(self.current, before);
            }
            self.current = bucket;
        }
        self.link(bucket, item);
    }

    #[inline]
    fn link(&mut self, bucket: u64, item: u32) {
        let place = bucket as usize & (self.heads.len() - 1);
        let entry = Entry {
            item,
            next: self.heads[place],
        };
        if self.free == NONE {
            self.heads[place] = self.entries.len() as u32;
            self.entries.push(entry);
        } else {
            self.heads[place] = self.free;
            let kept = &mut self.entries[self.free as usize];
            self.free = kept.next;
            *kept = entry;
        }
    }

    /// Takes the last entry of the lowest bucket.
    #[inline]
    pub(super) fn pop(&mut self) -> Option<u32> {
        if self.len == 0 {
            return None;
        }
        self.len -= 1;
        if self.held != NONE {
            return Some(std::mem::replace(&mut self.held, NONE));
        }
        let mask = self.heads.len() - 1;
        let mut place = self.current as usize & mask;
        while self.heads[place] == NONE {
            self.current += 1;
            place = self.current as usize & mask;
        }
        let head = self.heads[place];
        let entry = &mut self.entries[head as usize];
        self.heads[place] = entry.next;
        entry.next = self.free;
        self.free = head;
        Some(entry.item)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn entries_come_by_bucket_and_none_is_lost(
            rises in proptest::collection::vec((0..5000_u64, any::<bool>()), 1..300), width_bits in 1..9_u32,
        ) {
            let mut queue = Buckets::new(5000, 1 << width_bits);
            let (mut waiting, mut floor) = (Vec::new(), 77_u64);
            for (item, (rise, takes)) in rises.iter().enumerate() {
                queue.push(floor + rise, item as u32);
                waiting.push((floor + rise, item as u32));
                if *takes {
                    let taken = queue.pop().unwrap();
                    let place = waiting.iter().position(|(_, item)| *item == taken).unwrap();
                    let (priority, _) = waiting.swap_remove(place);
                    let width = 1 << width_bits;
                    prop_assert!(waiting.iter().all(|(other, _)| other / width >= priority / width));
                    floor = priority;
                }
            }
            let mut left = std::iter::from_fn(|| queue.pop()).collect::<Vec<u32>>();
            left.sort_unstable();
            let mut expected: Vec<u32> = waiting.iter().map(|(_, item)| *item).collect();
            expected.sort_unstable();
            prop_assert_eq!(left, expected);
        }
    }
}
