#![doc = include_str!("../pages/index.md")]

#[doc = include_str!("../pages/model.md")]
pub mod model {}

#[doc = include_str!("../pages/table.md")]
pub mod table {}

#[doc = include_str!("../pages/controller.md")]
pub mod controller {}

#[doc = include_str!("../pages/experiment.md")]
pub mod experiment {}

#[doc = include_str!("../pages/identify.md")]
pub mod identify {}

#[doc = include_str!("../pages/trust.md")]
pub mod trust {}

#[doc = include_str!("../pages/contribute.md")]
pub mod contribute {}
