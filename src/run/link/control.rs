//! The scenario runner's end of the link: lets the persons enter, asks how it is going, and ends the world. Every question
//! waits for its answer; for use by tools and tests, not by actors.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use tomoswarm_proto::VehicleId;

use super::{
    FrameError, FromWorld, LinkRefusal, PLACES_LIMIT, ToWorld, WordError, WorldStatus, decode,
    encode, read_frame, write_frame,
};
use crate::geom::Point;

/// The world answers within this time, or is given up.
const ANSWERS_WITHIN: Duration = Duration::from_secs(5);

/// Why the world gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// There is no connection.
    #[error("the world cannot be reached: {0}")]
    Unreachable(#[from] io::Error),
    /// The connection has ended.
    #[error("the world has gone: {0}")]
    Gone(#[from] FrameError),
    /// The world does not listen.
    #[error("{0}")]
    Refused(LinkRefusal),
    /// The answer makes no sense.
    #[error("{0}")]
    Word(#[from] WordError),
    /// The answer is one to another question.
    #[error("the world answered something else than was asked")]
    Unexpected,
}

/// A connection that directs the scenario.
#[derive(Debug)]
pub struct WorldControl {
    stream: TcpStream,
}

impl WorldControl {
    /// Connects to a world.
    ///
    /// # Errors
    /// It cannot be reached, or refuses.
    pub fn connect(address: SocketAddr, token: &str) -> Result<WorldControl, ControlError> {
        let stream = TcpStream::connect_timeout(&address, ANSWERS_WITHIN)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(ANSWERS_WITHIN))?;
        stream.set_write_timeout(Some(ANSWERS_WITHIN))?;
        let mut control = WorldControl { stream };
        match control.ask(&ToWorld::Control {
            token: token.as_bytes().to_vec(),
        })? {
            FromWorld::Welcome(_) => Ok(control),
            _other => Err(ControlError::Unexpected),
        }
    }

    /// Lets the persons enter; nothing more happens when they are in already.
    ///
    /// # Errors
    /// There is no answer.
    pub fn enter(&mut self) -> Result<WorldStatus, ControlError> {
        self.status(&ToWorld::Enter)
    }

    /// Asks how it is going.
    ///
    /// # Errors
    /// There is no answer.
    pub fn report(&mut self) -> Result<WorldStatus, ControlError> {
        self.status(&ToWorld::Report)
    }

    /// Ends the world in order.
    ///
    /// # Errors
    /// There is no answer.
    pub fn stop(&mut self) -> Result<WorldStatus, ControlError> {
        self.status(&ToWorld::Stop)
    }

    /// Asks where a vehicle truly was, about once a second.
    ///
    /// # Errors
    /// There is no answer.
    pub fn track(&mut self, vehicle: VehicleId) -> Result<Vec<Point>, ControlError> {
        let mut track = Vec::new();
        loop {
            let from = u32::try_from(track.len()).unwrap_or(u32::MAX);
            match self.ask(&ToWorld::Track { vehicle, from })? {
                FromWorld::Places(places) => {
                    let is_end = places.len() < PLACES_LIMIT;
                    track.extend(places);
                    if is_end {
                        return Ok(track);
                    }
                }
                _other => return Err(ControlError::Unexpected),
            }
        }
    }

    fn status(&mut self, word: &ToWorld) -> Result<WorldStatus, ControlError> {
        match self.ask(word)? {
            FromWorld::Status(status) => Ok(status),
            _other => Err(ControlError::Unexpected),
        }
    }

    fn ask(&mut self, word: &ToWorld) -> Result<FromWorld, ControlError> {
        let frame = encode(word).map_err(io::Error::other)?;
        write_frame(&mut self.stream, &frame)?;
        match decode(&read_frame(&mut self.stream)?)? {
            FromWorld::Refused(refused) => Err(ControlError::Refused(refused)),
            answer => Ok(answer),
        }
    }
}
