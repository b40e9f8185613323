//! What a store gives back: after a restart, and for exports. Changes nothing.

use std::sync::Arc;

use std::collections::BTreeMap;

use rusqlite::{OptionalExtension, Row, params};
use serde::Deserialize;
use tomoswarm_proto::{
    Boot, LayerId, Mark, Position, RunId, Samples, TILE_CELLS, TileAddress, TileReport, VehicleId,
};

use super::{GroundStore, MEMORY, UtcOffset, schema};
use crate::geom::{PixelGrid, Point, Rect};
use crate::ground::MeasuredSample;
use crate::store::{StoreError, sample_row};
use crate::tomo::{Finds, Image, Peak};

/// Samples of one batch that is given back.
const BATCH: usize = 4096;

/// All that a ground station needs to go on where it was.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct RestoredStore {
    /// The store's id.
    pub store: u64,
    /// What the station remembered; `None` when there is nothing, or nothing that this version can read.
    pub memory: Option<Vec<u8>>,
    /// The version that wrote a memory which this one cannot read.
    pub foreign_memory: Option<String>,
    /// All samples, ascending by vehicle, boot, run and sequence.
    pub samples: Vec<Samples>,
    /// All tiles, ascending by layer and address.
    pub tiles: Vec<TileReport>,
    /// How many pictures there are.
    pub pictures: u32,
    /// All runs, ascending.
    pub runs: Vec<StoredRun>,
}

/// How a store came about: one of its starts.
#[derive(Clone, PartialEq, Debug)]
pub struct Provenance {
    /// When, seconds since 1970.
    pub started_utc_s: f64,
    /// Of the program.
    pub version: String,
    /// Text of the ground station's config.
    pub config: String,
    /// Text of the venue file.
    pub venue: String,
    /// Seed of a simulated world.
    pub seed: Option<u64>,
    /// The operator's note.
    pub note: Option<String>,
}

/// A run in the store.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StoredRun {
    /// Its name.
    pub run: RunId,
    /// The run that was measured with nobody inside.
    pub empty: Option<RunId>,
    /// When it began, seconds since 1970.
    pub began_utc_s: f64,
    /// When it was closed.
    pub closed_utc_s: Option<f64>,
}

/// A place in the store where somebody truly stood.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StoredMark {
    /// Where, metres in the venue's frame.
    pub at: Point,
    /// How high, metres.
    pub z_m: f64,
    /// When that was stored, seconds since 1970.
    pub marked_utc_s: f64,
}

/// A picture in the store.
#[derive(Clone, PartialEq, Debug)]
pub struct StoredImage {
    /// After how many laps.
    pub laps: u32,
    /// `change` or `structure`.
    pub kind: String,
    /// The values.
    pub image: Image,
    /// Strong places, strongest first.
    pub peaks: Vec<Peak>,
    /// Who was found, in a change.
    pub finds: Option<Finds>,
    /// Standard deviation of every pixel, dB/m, in the order of the image; `None` where it was not computed, and in images of
    /// before.
    pub deviation: Option<Vec<f64>>,
    /// Links in the image.
    pub links: usize,
    /// Root mean square of what the image does not explain, dB.
    pub residual_rms_db: f64,
    /// When it was made, seconds since 1970.
    pub made_utc_s: f64,
}

/// A peak as it is stored.
#[derive(Deserialize)]
struct PeakRow {
    x_m: f64,
    y_m: f64,
    strength: f64,
    significance: Option<f64>,
}

/// What stores of before say for a peak of an image without noise to compare with.
const NO_NOISE: f64 = 1e9;

impl GroundStore {
    /// Returns all that a station needs to go on.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn resume(&self) -> Result<RestoredStore, StoreError> {
        let memory: Option<(String, Vec<u8>)> = self.read(|store| {
            let query = "SELECT version, blob FROM memory";
            store
                .connection
                .query_row(query, [], |row| Ok((row.get(0)?, row.get(1)?)))
                .optional()
        })?;
        let (memory, foreign_memory) = match memory {
            Some((version, blob)) if version == MEMORY => (Some(blob), None),
            Some((version, _)) => (None, Some(version)),
            None => (None, None),
        };
        let mut samples: Vec<Samples> = Vec::new();
        self.each_sample(None, |stored| {
            let MeasuredSample {
                vehicle,
                boot,
                run,
                sample,
                utc_s: _,
            } = stored;
            let fits = |batch: &Samples| {
                (batch.vehicle, batch.boot, batch.run) == (vehicle, boot, run)
                    && batch.samples.len() < BATCH
            };
            if !samples.last().is_some_and(fits) {
                samples.push(Samples {
                    vehicle,
                    boot,
                    run,
                    ..Samples::default()
                });
            }
            if let Some(batch) = samples.last_mut() {
                batch.samples.push(sample);
            }
        })?;
        let pictures = self.read(|store| {
            store
                .connection
                .query_row("SELECT count(*) FROM images", [], |row| row.get(0))
        })?;
        let (tiles, runs) = (self.tiles()?, self.runs()?);
        Ok(RestoredStore {
            store: self.id,
            memory,
            foreign_memory,
            samples,
            tiles,
            pictures,
            runs,
        })
    }

    /// Returns what the station remembered, if this version can read it.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn memory(&self) -> Result<Option<Vec<u8>>, StoreError> {
        self.read(|store| {
            let query = "SELECT blob FROM memory WHERE version = ?";
            store
                .connection
                .query_row(query, [MEMORY], |row| row.get(0))
                .optional()
        })
    }

    /// Returns all tiles, ascending by layer and address.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn tiles(&self) -> Result<Vec<TileReport>, StoreError> {
        self.read(|store| {
            let mut statement = store.connection.prepare(
                "SELECT vehicle, boot, slice, x, y, revision, cells FROM tiles
                 WHERE length(cells) = ? ORDER BY vehicle, boot, slice, x, y",
            )?;
            statement.query_map([TILE_CELLS as i64], tile)?.collect()
        })
    }

    /// Hands over every sample, of one run or of all, ascending by vehicle, boot, run and sequence.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn each_sample(
        &self,
        run: Option<RunId>,
        mut hand_over: impl FnMut(MeasuredSample),
    ) -> Result<(), StoreError> {
        self.read(|store| {
            let mut statement = store.connection.prepare(&format!(
                "SELECT vehicle, boot, run, utc_s, utc_error_s, {} FROM samples WHERE ?1 IS NULL OR run = ?1
                 ORDER BY vehicle, boot, run, sequence",
                sample_row::NAMES
            ))?;
            let rows = statement.query_map([run.map(|run| run.0)], |row| {
                let utc_s: Option<f64> = row.get(3)?;
                let error_s: Option<f64> = row.get(4)?;
                Ok(MeasuredSample {
                    vehicle: VehicleId(row.get(0)?),
                    boot: Boot(row.get(1)?),
                    run: RunId(row.get(2)?),
                    sample: sample_row::read(row, 5)?,
                    utc_s: utc_s.zip(error_s),
                })
            })?;
            for row in rows {
                hand_over(row?);
            }
            Ok(())
        })
    }

    /// Returns all runs, ascending.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn runs(&self) -> Result<Vec<StoredRun>, StoreError> {
        self.read(|store| {
            let query = "SELECT run, empty_run, began_utc_s, closed_utc_s FROM runs ORDER BY run";
            let mut statement = store.connection.prepare(query)?;
            let rows = statement.query_map([], |row| {
                Ok(StoredRun {
                    run: RunId(row.get(0)?),
                    empty: row.get::<_, Option<u32>>(1)?.map(RunId),
                    began_utc_s: row.get(2)?,
                    closed_utc_s: row.get(3)?,
                })
            })?;
            rows.collect()
        })
    }

    /// Returns the marks of the newest runs, so many at most, the last that was marked first.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn newest_marks(&self, most: usize) -> Result<Vec<Mark>, StoreError> {
        self.read(|store| {
            let query = "SELECT run, x_m, y_m, z_m FROM marks ORDER BY run DESC, marked_utc_s DESC, x_m, y_m LIMIT ?";
            let mut statement = store.connection.prepare(query)?;
            let rows = statement.query_map([most as i64], |row| {
                Ok(Mark {
                    run: RunId(row.get(0)?),
                    at: Position::from_metres(row.get(1)?, row.get(2)?, row.get(3)?),
                    stands: true,
                })
            })?;
            rows.collect()
        })
    }

    /// Returns the runs in which somebody was marked, ascending; nothing else need be known of them.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn marked_runs(&self) -> Result<Vec<RunId>, StoreError> {
        self.read(|store| {
            // Who only reads does not bring the tables up to date.
            if schema::version(&store.connection)? < 3 {
                return Ok(Vec::new());
            }
            let query = "SELECT DISTINCT run FROM marks ORDER BY run";
            let mut statement = store.connection.prepare(query)?;
            let rows = statement.query_map([], |row| Ok(RunId(row.get(0)?)))?;
            rows.collect()
        })
    }

    /// Returns where somebody truly stood in a run, in the order in which that was marked.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn marks(&self, run: RunId) -> Result<Vec<StoredMark>, StoreError> {
        self.read(|store| {
            // Who only reads does not bring the tables up to date.
            if schema::version(&store.connection)? < 3 {
                return Ok(Vec::new());
            }
            let query = "SELECT x_m, y_m, z_m, marked_utc_s FROM marks WHERE run = ? ORDER BY marked_utc_s, x_m, y_m";
            let mut statement = store.connection.prepare(query)?;
            let rows = statement.query_map([run.0], |row| {
                Ok(StoredMark {
                    at: Point::new(row.get(0)?, row.get(1)?),
                    z_m: row.get(2)?,
                    marked_utc_s: row.get(3)?,
                })
            })?;
            rows.collect()
        })
    }

    /// Returns the newest picture of each kind of a run.
    ///
    /// # Errors
    /// The file cannot be read, or a picture in it makes no sense.
    pub fn newest_images(&self, run: RunId) -> Result<Vec<StoredImage>, StoreError> {
        let rows: Vec<(StoredImage, ImageFields)> = self.read(|store| {
            // Who only reads does not bring the tables up to date.
            let later = match schema::version(&store.connection)? {
                ..2 => "'null', NULL",
                2 | 3 => "finds, NULL",
                _ => "finds, deviation",
            };
            let mut statement = store.connection.prepare(&format!(
                "SELECT max(laps), kind, rows, columns, x0_m, y0_m, x1_m, y1_m, links,
                        residual_db, made_utc_s, peaks, data, {later} FROM images
                 WHERE run = ? GROUP BY kind ORDER BY kind"
            ))?;
            statement.query_map(params![run.0], image)?.collect()
        })?;
        rows.into_iter()
            .map(|(image, fields)| self.whole(image, &fields))
            .collect()
    }

    /// Returns how the store came about, the newest start first.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn provenance(&self) -> Result<Vec<Provenance>, StoreError> {
        self.read(|store| {
            let mut statement = store.connection.prepare(
                "SELECT started_utc_s, version, config, venue, seed, note FROM provenance ORDER BY rowid DESC",
            )?;
            let rows = statement.query_map([], |row| {
                Ok(Provenance {
                    started_utc_s: row.get(0)?,
                    version: row.get(1)?,
                    config: row.get(2)?,
                    venue: row.get(3)?,
                    seed: row.get::<_, Option<i64>>(4)?.map(i64::cast_unsigned),
                    note: row.get(5)?,
                })
            })?;
            rows.collect()
        })
    }

    /// Returns the store's id and its venue's hash.
    pub(super) fn identity(&self) -> Result<(u64, u64), StoreError> {
        let (id, hash): (String, String) = self.read(|store| {
            let query = "SELECT id, venue_hash FROM store";
            store
                .connection
                .query_row(query, [], |row| Ok((row.get(0)?, row.get(1)?)))
        })?;
        let number = |text: &str| {
            let reason = format!("{text:?} where 16 hexadecimal digits are expected");
            let path = self.path.clone();
            u64::from_str_radix(text, 16).map_err(|_| StoreError::Damaged { path, reason })
        };
        Ok((number(&id)?, number(&hash)?))
    }

    /// Returns the clocks that are known.
    pub(super) fn read_clocks(&self) -> Result<BTreeMap<(VehicleId, Boot), UtcOffset>, StoreError> {
        self.read(|store| {
            let mut statement = store.connection.prepare(
                "SELECT vehicle, boot, utc_offset_s, utc_error_s FROM vehicles
                 WHERE utc_offset_s IS NOT NULL AND utc_error_s IS NOT NULL",
            )?;
            let rows = statement.query_map([], |row| {
                let clock = UtcOffset {
                    offset_s: row.get(2)?,
                    error_s: row.get(3)?,
                };
                Ok(((VehicleId(row.get(0)?), Boot(row.get(1)?)), clock))
            })?;
            rows.collect()
        })
    }

    fn read<T>(
        &self,
        work: impl FnOnce(&GroundStore) -> rusqlite::Result<T>,
    ) -> Result<T, StoreError> {
        work(self).map_err(|source| StoreError::of(&self.path, source))
    }

    /// Puts values, deviation, peaks and finds into a picture.
    fn whole(
        &self,
        mut image: StoredImage,
        fields: &ImageFields,
    ) -> Result<StoredImage, StoreError> {
        let damaged = |reason: String| StoreError::Damaged {
            path: self.path.clone(),
            reason,
        };
        let pixels = image.image.grid.columns.checked_mul(image.image.grid.rows);
        let numbers = |what: &str, data: &[u8]| {
            let (numbers, rest) = data.as_chunks::<4>();
            if pixels != Some(numbers.len()) || !rest.is_empty() {
                let length = data.len();
                return Err(damaged(format!("an image has {length} bytes of {what}")));
            }
            let numbers = numbers.iter().map(|bytes| f32::from_le_bytes(*bytes));
            Ok(numbers.map(f64::from).collect())
        };
        image.image.values = numbers("values", &fields.values)?;
        let deviation = fields.deviation.as_deref();
        image.deviation = deviation
            .map(|deviation| numbers("deviations", deviation))
            .transpose()?;
        image.finds = serde_json::from_str(&fields.finds)
            .map_err(|error| damaged(format!("finds of an image: {error}")))?;
        let rows: Vec<PeakRow> = serde_json::from_str(&fields.peaks)
            .map_err(|error| damaged(format!("peaks of an image: {error}")))?;
        image.peaks = rows
            .into_iter()
            .map(
                |PeakRow {
                     x_m,
                     y_m,
                     strength,
                     significance,
                 }| Peak {
                    at: Point::new(x_m, y_m),
                    strength,
                    significance: significance.filter(|ratio| *ratio < NO_NOISE),
                },
            )
            .collect();
        Ok(image)
    }
}

fn tile(row: &Row) -> rusqlite::Result<TileReport> {
    let bytes: Vec<u8> = row.get(6)?;
    // The query takes only tiles of the right length.
    let cells = std::array::from_fn(|index| bytes.get(index).map_or(0, |byte| byte.cast_signed()));
    Ok(TileReport {
        layer: LayerId {
            vehicle: VehicleId(row.get(0)?),
            boot: Boot(row.get(1)?),
        },
        address: TileAddress {
            slice: row.get(2)?,
            x: row.get(3)?,
            y: row.get(4)?,
        },
        revision: row.get(5)?,
        cells: Arc::new(cells),
    })
}

/// What of a picture is stored as text or bytes.
struct ImageFields {
    peaks: String,
    values: Vec<u8>,
    finds: String,
    deviation: Option<Vec<u8>>,
}

/// Returns a picture without that of it which is stored as text or bytes, and this.
fn image(row: &Row) -> rusqlite::Result<(StoredImage, ImageFields)> {
    let corner =
        |x: usize, y: usize| Ok::<_, rusqlite::Error>(Point::new(row.get(x)?, row.get(y)?));
    let count = |index: usize| row.get::<_, u32>(index).map(|count| count as usize);
    let grid = PixelGrid {
        area: Rect::new(corner(4, 5)?, corner(6, 7)?),
        columns: count(3)?,
        rows: count(2)?,
    };
    let image = StoredImage {
        laps: row.get(0)?,
        kind: row.get(1)?,
        image: Image {
            grid,
            values: Vec::new(),
        },
        peaks: Vec::new(),
        finds: None,
        deviation: None,
        links: count(8)?,
        made_utc_s: row.get(10)?,
        residual_rms_db: row.get::<_, Option<f64>>(9)?.unwrap_or(f64::NAN),
    };
    let fields = ImageFields {
        peaks: row.get(11)?,
        values: row.get(12)?,
        finds: row.get(13)?,
        deviation: row.get(14)?,
    };
    Ok((image, fields))
}
