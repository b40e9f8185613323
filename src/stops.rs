//! Emergency stops: a state of the swarm, kept by every node alike. An operator gives a stop a name; every node that
//! hears of it keeps it, on disk where it has one, and says it on, by bus and by beacon, until an operator lifts that name.
//!
//! ```text
//!   bus ──Standing, Start that ends──► [`Stops`] ──open stops──► vehicle, mission, radio (one in every beacon)
//!   radio ──a beacon's stop──►                   ──Standing──► bus      ──Standing──► disk
//! ```
//!
//! [`StopSet`] is what is kept, and how two of them join; [`Stops`] is the actor that hears, says and judges. What a vehicle
//! does under an open stop is not decided here.

mod stop_set;
mod stops_actor;

pub use stop_set::{OPEN_BY_NAME, StopSet, first_that_stops};
pub use stops_actor::{In, Out, StopEvent, Stops, StopsSettings};
