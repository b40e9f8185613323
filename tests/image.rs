//! Images from outside: the command, recordings and phantoms of others, and two rovers around a wall.

mod image {
    mod command;
    mod phantoms;
    mod score;
    mod two_persons;
    mod world;
}
