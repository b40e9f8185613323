//! The commands that a vehicle's machine can do without: simulations, the ground station, the operator's. A build for vehicles
//! alone leaves them out, and with them all that only they use.

#[cfg(feature = "dash")]
use super::dash;
use super::error::CliError;
use super::standard_output::StandardOutput;
#[cfg(feature = "net")]
use super::{
    enroll, export, fix, ground, mock_autopilot, order, preflight, replay, status, tap, world,
};
use super::{experiment, image, plan, scene, sim};

/// One of these commands.
#[derive(clap::Subcommand, Debug)]
pub(super) enum StationCommand {
    Sim(sim::SimArgs),
    Image(Box<image::ImageCommand>),
    Plan(plan::PlanArgs),
    Experiment(experiment::ExperimentArgs),
    Scene(scene::SceneArgs),
    #[cfg(feature = "net")]
    Ground(ground::GroundArgs),
    #[cfg(feature = "net")]
    World(world::WorldArgs),
    #[cfg(feature = "net")]
    MockAutopilot(mock_autopilot::MockAutopilotArgs),
    #[cfg(feature = "net")]
    Enroll(enroll::EnrollArgs),
    #[cfg(feature = "net")]
    Export(export::ExportArgs),
    #[cfg(feature = "net")]
    Order(order::OrderArgs),
    #[cfg(feature = "net")]
    Status(status::StatusArgs),
    #[cfg(feature = "dash")]
    Dash(dash::DashArgs),
    #[cfg(feature = "net")]
    Tap(tap::TapArgs),
    #[cfg(feature = "net")]
    Preflight(preflight::PreflightArgs),
    #[cfg(feature = "net")]
    Fix(fix::FixArgs),
    #[cfg(feature = "net")]
    Replay(replay::ReplayArgs),
}

impl StationCommand {
    /// Runs the command.
    ///
    /// # Errors
    /// As the command says.
    pub(super) fn run(&self, out: &mut StandardOutput) -> Result<(), CliError> {
        match self {
            StationCommand::Sim(command) => command.run(out),
            StationCommand::Image(command) => command.run(out),
            StationCommand::Plan(command) => command.run(out),
            StationCommand::Experiment(command) => command.run(out),
            StationCommand::Scene(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Ground(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::World(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::MockAutopilot(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Enroll(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Export(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Order(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Status(command) => command.run(out),
            #[cfg(feature = "dash")]
            StationCommand::Dash(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Tap(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Preflight(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Fix(command) => command.run(out),
            #[cfg(feature = "net")]
            StationCommand::Replay(command) => command.run(out),
        }
    }
}
