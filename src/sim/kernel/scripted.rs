//! How the kernel carries out the scenario's script: it takes steps and does what follows. When and why is
//! the script's own business.

use tomoswarm_proto::OrderKind;

use super::{Event, Kernel};
use crate::actor::Fault;
use crate::ground::station::Wish;
use crate::ground::{self, imager};
use crate::sim::script::{Act, Next, Step};

impl Kernel {
    pub(super) fn picture(&mut self, picture: imager::Picture) {
        let next = self.script.picture(picture.run, picture.subject);
        self.record.picture(self.now, picture);
        self.follow(next);
    }

    pub(super) fn script(&mut self, step: Step) -> Result<(), Fault> {
        if step == Step::GiveUpWaiting && self.ended.is_some() {
            return Ok(());
        }
        let (act, next) = self.script.step(step);
        self.follow(next);
        match act {
            Act::Sweep { run, empty } => {
                self.log("scenario", format_args!("sweep {run} is wished"));
                self.tell_ground(ground::Event::Operator(Wish::Sweep { run, empty }))
            }
            Act::Start => {
                self.log("scenario", format_args!("the missions begin"));
                self.tell_ground(ground::Event::Operator(Wish::Order(OrderKind::Start)))
            }
            Act::Enter(stage) => {
                if let Some(stage) = stage {
                    let mut said = Vec::new();
                    self.environment.set_stage(self.now, *stage, &mut said);
                    self.schedule(&mut said);
                }
                self.log("scenario", format_args!("the persons enter"));
                Ok(())
            }
            Act::ReturnHome => self.tell_ground(ground::Event::Operator(Wish::Order(OrderKind::Return))),
            Act::Fail(reason) => {
                self.follow(Next::Fail(reason));
                Ok(())
            }
        }
    }

    /// Does what follows by the script.
    pub(super) fn follow(&mut self, next: Next) {
        match next {
            Next::Nothing => {}
            Next::Step(after, step) => self.queue.push(self.now + after, Event::Script(step)),
            Next::End => self.end(),
            Next::Fail(reason) => {
                self.record.failure = Some(reason);
                self.end();
            }
        }
    }
}
