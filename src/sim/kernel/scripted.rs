//! How the kernel carries out the scenario's script: it takes steps and does what follows. When and why is
//! the script's own business.

use tomoswarm_proto::{OrderKind, RunId};

use super::{Event, Kernel};
use crate::actor::Fault;
use crate::ground::station::Wish;
use crate::ground::{self, imager};
use crate::sim::script::{Act, Next, Step};
use crate::sim::shadow::Deed;

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
        self.script_deeds.extend(deed(&act));
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
        let ends = match next {
            Next::End => Some(Deed::Ends),
            Next::Fail(_) => Some(Deed::GivesUp),
            Next::Nothing | Next::Step(..) => None,
        };
        self.script_deeds.extend(ends.filter(|_| self.ended.is_none()));
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

/// Returns what a script does in an act, to be compared with what an operator would do.
fn deed(act: &Act) -> Option<Deed> {
    match act {
        Act::Sweep { run, .. } => Some(Deed::Start(*run)),
        Act::Start => Some(Deed::Start(RunId::default())),
        Act::Enter(_) => Some(Deed::PersonsEnter),
        Act::ReturnHome => Some(Deed::Return),
        Act::Fail(_) => None,
    }
}
