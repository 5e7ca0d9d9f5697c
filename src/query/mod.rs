//! Queries: offline, of shape pairs; and of a running daemon, of its bodies as of a tick.
pub mod batch;
mod gap;
mod going;
mod impact;
mod measure;
mod nearest;
mod ray;
mod touching;
mod unknown;

pub use gap::GapQuestion;
pub use impact::ImpactQuestion;
pub use ray::RayQuestion;
pub use touching::TouchingQuestion;

use measure::fit_boxes;

use crate::scene::Question;
use crate::time::Clock;
use crate::wire::{Answer, MessageHeader};
use crate::world::{Parts, World};

/// A self-contained question that a worker answers while ticks go on.
#[derive(Clone, Debug)]
pub enum Query {
    /// The gap of two bodies.
    Gap(Box<GapQuestion>),
    /// What a body or a shape touches.
    Touching(Box<TouchingQuestion>),
    /// What a ray hits.
    Ray(Box<RayQuestion>),
    /// When two bodies touch.
    Impact(Box<ImpactQuestion>),
}

impl Query {
    /// Copies the bodies at their present poses.
    ///
    /// * `header` - of the tick that left the world in this state.
    /// * `shapes` - those of [`Question::shapes`], built.
    ///
    /// # Errors
    /// Why there is no answer, and what to change.
    pub fn new(
        world: &World,
        header: MessageHeader,
        asked: &Question,
        shapes: Option<&Parts>,
    ) -> Result<Self, String> {
        match asked {
            Question::Gap { a, b } => {
                GapQuestion::new(world, header, a, b).map(|it| Self::Gap(Box::new(it)))
            }
            Question::Touching(asked) => TouchingQuestion::new(world, header, asked, shapes)
                .map(|it| Self::Touching(Box::new(it))),
            Question::Impact(asked) => {
                ImpactQuestion::new(world, header, asked).map(|it| Self::Impact(Box::new(it)))
            }
            Question::Ray(ray) => Ok(Self::Ray(Box::new(RayQuestion::new(world, header, ray)))),
        }
    }

    /// Warnings: what is odd, but allowed.
    pub fn warnings(&mut self) -> &mut Vec<String> {
        match self {
            Self::Gap(question) => &mut question.warnings,
            Self::Touching(question) => &mut question.warnings,
            Self::Ray(question) => &mut question.warnings,
            Self::Impact(question) => &mut question.warnings,
        }
    }

    /// Works on the answer, for a second at most, and before that for a quarter of a second if boxes must be fitted.
    #[must_use]
    pub fn answer(mut self, clock: &dyn Clock) -> Answer {
        let mut answer = Answer {
            ok: true,
            warnings: std::mem::take(self.warnings()),
            ..Answer::default()
        };
        match &mut self {
            Self::Gap(question) => fit_boxes(question.bodies_mut(), clock),
            Self::Touching(question) => fit_boxes(question.bodies_mut(), clock),
            Self::Ray(question) => fit_boxes(question.bodies_mut(), clock),
            Self::Impact(question) => fit_boxes(question.bodies_mut(), clock),
        }
        let header = match self {
            Self::Gap(question) => answer.gap.insert(question.answer(clock)).tick_header,
            Self::Touching(question) => answer.touching.insert(question.answer(clock)).tick_header,
            Self::Ray(question) => answer.ray.insert(question.answer(clock)).tick_header,
            Self::Impact(question) => answer.impact.insert(question.answer(clock)).tick_header,
        };
        answer.scene_rev = header.scene_rev;
        answer
    }
}
