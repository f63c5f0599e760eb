//! Robots by the macro, whose sources are not checked in.

use regen_runtime::robot_model;

robot_model!("../../../robots/3prs.yaml");
robot_model!("../../../robots/3rrr.yaml");
robot_model!("../../../robots/hybrid.yaml");
robot_model!("../../../robots/iiwa14.yaml");
robot_model!("../../../robots/linear_delta.yaml");
robot_model!("../../../robots/palletiser.yaml");
robot_model!("../../../robots/panda.yaml");
robot_model!("../../../robots/rx90.yaml");
robot_model!("../../../robots/scara.yaml");
robot_model!("../../../robots/slider_crank.yaml");
robot_model!("../../../robots/stanford.yaml");
robot_model!("../../../robots/stewart.yaml");
robot_model!("../../../robots/tree_branch.yaml");
robot_model!("../../../robots/ur5e.yaml");
