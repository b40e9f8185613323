//! Configuration files from outside: what is bundled, what holds for all of them, and what is refused.

mod config {
    mod bundled;
    mod bus;
    mod laws;
    mod missions;
    mod nodes;
    mod problems;
    mod readme;
}
