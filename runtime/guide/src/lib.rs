#![doc = include_str!("../pages/index.md")]

#[doc = include_str!("../pages/model.md")]
pub mod model {}

#[doc = include_str!("../pages/recipes.md")]
pub mod recipes {}

#[doc = include_str!("../pages/table.md")]
pub mod table {}

#[doc = include_str!("../pages/controller.md")]
pub mod controller {}

#[doc = include_str!("../pages/c.md")]
pub mod c {}

#[doc = include_str!("../pages/ros2.md")]
pub mod ros2 {}

#[doc = include_str!("../pages/simulink.md")]
pub mod simulink {}

#[doc = include_str!("../pages/plc.md")]
pub mod plc {}

#[doc = include_str!("../pages/optimise.md")]
pub mod optimise {}

#[doc = include_str!("../pages/equations.md")]
pub mod equations {}

#[doc = include_str!("../pages/serve.md")]
pub mod serve {}

#[doc = include_str!("../pages/experiment.md")]
#[doc = include_str!("../pages/figures/position-turns.svg")]
pub mod experiment {}

#[doc = include_str!("../pages/identify.md")]
#[doc = include_str!("../pages/figures/deviations.svg")]
pub mod identify {}

#[doc = include_str!("../pages/logs.md")]
pub mod logs {}

#[doc = include_str!("../pages/inspect.md")]
pub mod inspect {}

#[doc = include_str!("../pages/loads.md")]
pub mod loads {}

#[doc = include_str!("../pages/response.md")]
pub mod response {}

#[doc = include_str!("../pages/rehearse.md")]
pub mod rehearse {}

#[doc = include_str!("../pages/calibrate.md")]
pub mod calibrate {}

#[doc = include_str!("../pages/estimators.md")]
pub mod estimators {}
#[doc = include_str!("../pages/python.md")]
pub mod python {}

#[doc = include_str!("../pages/trust.md")]
#[doc = include_str!("../pages/figures/singular-values.svg")]
pub mod trust {}

#[doc = include_str!("../pages/evidence.md")]
#[doc = include_str!("../pages/evidence-table.md")]
pub mod evidence {}

#[doc = include_str!("../pages/numbers.md")]
pub mod numbers {}

#[doc = include_str!("../pages/commands.md")]
pub mod commands {}

#[doc = include_str!("../pages/reference.md")]
pub mod reference {}

#[doc = include_str!("../pages/compare.md")]
pub mod compare {}
