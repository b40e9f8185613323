//! What reading takes of the memory, whatever a frame claims to hold. A test binary of its own, since it counts every
//! allocation of the process.

#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::restriction,
    unreachable_pub,
    unsafe_code,
    reason = "no product code; it counts what is allocated"
)]

mod examples;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use examples::{examples, variants};
use tomoswarm_proto::codec::{decode, encode};

/// The system's memory; remembers the largest piece that was asked for.
struct Counted;

static LARGEST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: all work is done by the system's allocator, and what it is told is passed on unchanged.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        LARGEST.fetch_max(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static MEMORY: Counted = Counted;

/// The largest piece of memory that was asked for to read a frame, bytes.
fn largest(frame: &[u8]) -> usize {
    LARGEST.store(0, Ordering::Relaxed);
    let decoded = decode(frame);
    let largest = LARGEST.load(Ordering::Relaxed);
    drop(decoded);
    largest
}

#[test]
fn no_false_length_reserves_more_than_2_mib() {
    let lengths = [1_u64 << 62, 1 << 40, 1 << 30, 1 << 24, 1 << 21, 1 << 20];
    let mut most = 0;
    for (name, message) in examples().into_iter().chain(variants()) {
        let frame = encode(&message).unwrap();
        for at in 4..frame.len().min(600) {
            for length in lengths {
                // A length in place of whatever stands there.
                let claim = [&[253][..], &length.to_le_bytes()].concat();
                let taken = largest(&[&frame[..at], &claim, &frame[at..]].concat());
                assert!(
                    taken <= 2 * 1024 * 1024,
                    "{name} at {at}, {length}: {taken} bytes"
                );
                most = most.max(taken);
            }
        }
    }
    println!("largest piece: {most} bytes");
    // Something was counted at all.
    assert!(most > 1000);
}
