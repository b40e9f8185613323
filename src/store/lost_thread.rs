//! What is said of a thread that has ended although its owner lasts: it has panicked, and nobody does what it did until the
//! node is started anew. Nothing is started here.

use std::thread::JoinHandle;

/// Returns what is wrong with a thread that has ended, in words; to be asked by who ends it only by being dropped itself.
pub fn lost_thread(thread: Option<&JoinHandle<()>>) -> Option<String> {
    let is_lost = thread.is_some_and(JoinHandle::is_finished);
    is_lost.then(|| "its thread has ended; start the node anew".to_owned())
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn a_thread_is_lost_when_it_has_ended_and_not_before() {
        let (end, ended) = channel::<()>();
        let thread = std::thread::spawn(move || {
            let _ = ended.recv();
        });
        assert_eq!(lost_thread(Some(&thread)), None);
        drop(end);
        while !thread.is_finished() {
            std::thread::yield_now();
        }
        assert!(lost_thread(Some(&thread)).is_some());
        assert_eq!(lost_thread(None), None);
    }
}
