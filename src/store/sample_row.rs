//! A sample as columns of a table, the same in a vehicle's outbox and in the ground's store.

use rusqlite::{Row, Statement};
use tomoswarm_proto::{Deviation, Heading, PoseReport, Position, Sample, VehicleId};

/// The columns of a sample, as they are created.
pub(super) const DEFINITIONS: &str = "
    sequence INTEGER NOT NULL, heard_at_s REAL NOT NULL, transmitter INTEGER NOT NULL,
    tx_x_m REAL, tx_y_m REAL, tx_z_m REAL, tx_heading_rad REAL, tx_sd_m REAL,
    rx_x_m REAL, rx_y_m REAL, rx_z_m REAL, rx_heading_rad REAL, rx_sd_m REAL,
    channel INTEGER NOT NULL, power_dbm INTEGER NOT NULL, rssi_dbm INTEGER";
/// Their names, in the order of [`bind`] and [`read`].
pub(super) const NAMES: &str = "sequence, heard_at_s, transmitter, tx_x_m, tx_y_m, tx_z_m, tx_heading_rad, \
    tx_sd_m, rx_x_m, rx_y_m, rx_z_m, rx_heading_rad, rx_sd_m, channel, power_dbm, rssi_dbm";
/// How many they are.
pub(super) const COUNT: usize = 16;

/// Returns so many question marks.
pub(super) fn marks(count: usize) -> String {
    vec!["?"; count].join(", ")
}

/// Returns when a sample was heard, seconds of the receiver's clock.
pub(super) fn heard_at_s(sample: &Sample) -> f64 {
    sample.heard_at_ns as f64 / 1e9
}

/// Binds a sample to parameters from the given one on (they count from 1).
pub(super) fn bind(
    statement: &mut Statement,
    first: usize,
    sample: &Sample,
) -> rusqlite::Result<()> {
    // The bits are kept: a number beyond the range of SQL is still told apart.
    statement.raw_bind_parameter(first, sample.sequence.cast_signed())?;
    statement.raw_bind_parameter(first + 1, heard_at_s(sample))?;
    statement.raw_bind_parameter(first + 2, sample.transmitter.0)?;
    for (at, pose) in [
        (first + 3, &sample.transmitter_pose),
        (first + 8, &sample.receiver_pose),
    ] {
        let PoseReport {
            at: place,
            heading,
            sd,
        } = *pose;
        let place_m = [place.x_m(), place.y_m(), place.z_m()];
        // What is not known is NULL.
        let numbers = place_m
            .into_iter()
            .chain([heading.radians(), sd.metres().unwrap_or(f64::NAN)]);
        for (offset, number) in numbers.enumerate() {
            statement.raw_bind_parameter(at + offset, number)?;
        }
    }
    statement.raw_bind_parameter(first + 13, sample.channel)?;
    statement.raw_bind_parameter(first + 14, sample.power_dbm)?;
    statement.raw_bind_parameter(first + 15, sample.rssi_dbm)
}

/// Reads a sample from columns from the given one on (they count from 0).
pub(super) fn read(row: &Row, first: usize) -> rusqlite::Result<Sample> {
    let pose = |at: usize| -> rusqlite::Result<PoseReport> {
        // What is no number is stored as NULL.
        let number = |offset: usize| {
            Ok::<_, rusqlite::Error>(row.get::<_, Option<f64>>(at + offset)?.unwrap_or(f64::NAN))
        };
        let place = Position::from_metres(number(0)?, number(1)?, number(2)?);
        let (heading, sd) = (
            Heading::from_radians(number(3)?),
            Deviation::from_metres(number(4)?),
        );
        Ok(PoseReport {
            at: place,
            heading,
            sd,
        })
    };
    Ok(Sample {
        sequence: row.get::<_, i64>(first)?.cast_unsigned(),
        heard_at_ns: (row.get::<_, f64>(first + 1)? * 1e9).round() as u64,
        transmitter: VehicleId(row.get(first + 2)?),
        transmitter_pose: pose(first + 3)?,
        receiver_pose: pose(first + 8)?,
        channel: row.get(first + 13)?,
        power_dbm: row.get(first + 14)?,
        rssi_dbm: row.get(first + 15)?,
    })
}
