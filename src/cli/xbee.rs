//! `tomoswarm xbee`: sets up the XBee of a vehicle, and shows what is set.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use clap::builder::NonEmptyStringValueParser;
use tomoswarm_proto::VehicleId;

use super::error::CliError;
use super::read;
use super::standard_output::complain;
use crate::config::{self, Config, Venue, XBEE_BAUDS};
use crate::hw::xbee_frame::ApiMode;
use crate::hw::xbee_registers::{Mismatches, ModuleSettings, READ, RegisterAnswer, Registers};
use crate::hw::xbee_setup::SetupSettings;
use crate::run::drivers::radio::xbee_tool::{XbeeToolError, registers, set_up};
use crate::run::drivers::usb_adapter::{self, USB_SERIAL};

/// Set up an XBee with 802.15.4 firmware, or show what is set.
#[derive(clap::Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub struct XbeeArgs {
    #[command(subcommand)]
    command: XbeeCommand,
}

#[derive(Subcommand, Debug)]
enum XbeeCommand {
    Setup(SetupArgs),
    Show(ShowArgs),
}

/// Find the module at a port, whatever its baud rate and mode, and write and save its registers.
#[derive(clap::Args, Debug)]
struct SetupArgs {
    /// The serial port, such as /dev/serial/by-id/usb-…
    #[arg(value_name = "PORT", value_parser = NonEmptyStringValueParser::new())]
    port: String,
    /// The vehicle's number, which becomes the module's address
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=250))]
    vehicle: u8,
    /// The venue's file: it says the channel, and its network follows from it
    #[arg(long, value_name = "FILE")]
    venue: PathBuf,
    /// Transmit power, dBm: that of a level of the module (XBee 3 and S2C: -5, -1, 2, 5, 8) [default: as it is]
    #[arg(long, value_name = "DBM", allow_hyphen_values = true)]
    power_dbm: Option<i8>,
    /// Its baud rate from then on
    #[arg(long, value_name = "B", default_value_t = 115_200, value_parser = baud)]
    baud: u32,
}

/// Show the registers of the module at a port; with --vehicle and --venue also in what they differ from what is wanted.
#[derive(clap::Args, Debug)]
struct ShowArgs {
    /// The serial port
    #[arg(value_name = "PORT", value_parser = NonEmptyStringValueParser::new())]
    port: String,
    /// Its baud rate
    #[arg(long, value_name = "B", default_value_t = 115_200, value_parser = baud)]
    baud: u32,
    /// Compare them with what this vehicle's are to be
    #[arg(long, value_name = "N", requires = "venue", value_parser = clap::value_parser!(u8).range(1..=250))]
    vehicle: Option<u8>,
    /// The venue's file
    #[arg(long, value_name = "FILE", requires = "vehicle")]
    venue: Option<PathBuf>,
    /// Compare its transmit power with this one, too, dBm
    #[arg(
        long,
        value_name = "DBM",
        requires = "vehicle",
        allow_hyphen_values = true
    )]
    power_dbm: Option<i8>,
}

const AFTER_HELP: &str = "\
Examples:
  tomoswarm xbee setup /dev/serial/by-id/usb-FTDI… --vehicle 3 --venue venue.toml
  tomoswarm xbee show /dev/serial/by-id/usb-FTDI… --vehicle 3 --venue venue.toml

Exit codes: 0 done; 1 no module answers, it refuses, or it differs from what is wanted; 2 bad usage or file.";

impl XbeeArgs {
    /// Sets up, or shows.
    ///
    /// # Errors
    /// A bad file, a port that cannot be used, a module that is not as wanted.
    pub fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        match &self.command {
            XbeeCommand::Setup(setup) => setup.run(out),
            XbeeCommand::Show(show) => show.run(out),
        }
    }
}

impl SetupArgs {
    fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let settings = SetupSettings {
            module: settings(
                self.vehicle,
                &self.venue,
                self.power_dbm.unwrap_or_default(),
            )?,
            baud: self.baud,
            keeps_power: self.power_dbm.is_none(),
        };
        let mut found = |baud: u32, mode: Option<ApiMode>| {
            let spoke = match mode {
                Some(mode) => format!("API mode {}", mode.register()),
                None => "no frames (transparent mode)".to_owned(),
            };
            complain(&format!("found at {baud} baud, {spoke}"));
        };
        let set = set_up(&self.port, settings, &mut found).map_err(|error| error_of(&error))?;
        show(&set, out)?;
        let Some(power_dbm) = set.power_dbm() else {
            return Ok(());
        };
        writeln!(
            out,
            "the vehicle's file is to say: [radio] power_dbm = {power_dbm}"
        )
        .map_err(CliError::stdout)
    }
}

impl ShowArgs {
    fn run(&self, out: &mut dyn Write) -> Result<(), CliError> {
        let wanted = match (self.vehicle, &self.venue) {
            (Some(vehicle), Some(venue)) => Some(settings(
                vehicle,
                venue,
                self.power_dbm.unwrap_or_default(),
            )?),
            // One needs the other.
            (Some(_), None) | (None, _) => None,
        };
        let found = registers(&self.port, self.baud).map_err(|error| error_of(&error))?;
        show(&found, out)?;
        if let Some(delay) = usb_adapter::delay_in_words(&self.port, Path::new(USB_SERIAL)) {
            complain(&format_args!("warning: {}: {delay}", self.port));
        }
        let Some(wanted) = wanted else { return Ok(()) };
        let of_its_own = found.power_dbm().unwrap_or(wanted.power_dbm);
        let wanted = ModuleSettings {
            power_dbm: self.power_dbm.unwrap_or(of_its_own),
            ..wanted
        };
        match found.mismatches(&wanted) {
            differences if differences.is_empty() => Ok(()),
            differences => Err(CliError::Swarm(Mismatches(differences).to_string())),
        }
    }
}

/// Reads a baud rate that a module can have.
fn baud(text: &str) -> Result<u32, String> {
    let given = text.parse().ok();
    given
        .filter(|baud| XBEE_BAUDS.contains(baud))
        .ok_or_else(|| {
            let known = XBEE_BAUDS.map(|baud| baud.to_string()).join(", ");
            format!("no module speaks at it; allowed: {known}")
        })
}

/// Returns what the module of a vehicle is to say of itself.
fn settings(vehicle: u8, venue_file: &Path, power_dbm: i8) -> Result<ModuleSettings, CliError> {
    let venue = venue(venue_file)?;
    let homes = venue.homes.len();
    if !(1..=homes).contains(&usize::from(vehicle)) {
        return Err(CliError::Usage(format!(
            "--vehicle {vehicle}: has no home in {}; 1 to {homes} is allowed",
            read::shown(venue_file)
        )));
    }
    Ok(ModuleSettings::of_venue(
        VehicleId(vehicle),
        &venue,
        power_dbm,
    ))
}

fn venue(path: &Path) -> Result<Venue, CliError> {
    let text = read::text(path)?;
    match config::read(&read::shown(path), &text, &mut read::around(path))? {
        Config::Venue(venue) => Ok(venue),
        _ => Err(CliError::Input {
            path: path.to_owned(),
            reason: "is of another kind; kind = \"venue\" is needed here".to_owned(),
        }),
    }
}

fn error_of(error: &XbeeToolError) -> CliError {
    CliError::Swarm(error.to_string())
}

/// Prints registers as the manuals write them, in hexadecimal digits.
fn show(registers: &Registers, out: &mut dyn Write) -> Result<(), CliError> {
    let mut text = String::new();
    for name in READ {
        let value = match registers.answer(name) {
            Some(RegisterAnswer::Value(value)) => format!("{value:X}"),
            Some(RegisterAnswer::Failed(status)) => format!("not told (status {status})"),
            Some(RegisterAnswer::NotKnown) | None => "not known".to_owned(),
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name} {value}");
    }
    let kind = registers.kind().map(|kind| format!("{kind:?}"));
    let power = registers.power_dbm().map(|power| format!(", {power} dBm"));
    let _ = writeln!(
        text,
        "{}{}, {} bytes a packet",
        kind.unwrap_or_else(|| "no XBee that carries beacons".to_owned()),
        power.unwrap_or_default(),
        registers.payload_most()
    );
    out.write_all(text.as_bytes()).map_err(CliError::stdout)
}
