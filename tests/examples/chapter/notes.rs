//! Notes printed below the tables: the results that agree with the chapter, and why others differ.

pub(crate) const FIGURE_2: &str = "\
Limits: the chapter names strokes, velocities and cones without their values; 0.6 +- 0.15 m,
0.6 m/s and 45 degrees are ours, 11 harmonics and 7.5 s are its own. Exact derivatives and a
continuation through smoothed criteria give condition numbers less than half of its.";

pub(crate) const TABLE_3: &str = "\
The order of the perturbed column is the chapter's: feasibility costs, nonlinear friction gains
more than that. On the original forces nonlinear is best as there; but here feasibility helps the
linear fit, where the chapter's rises from 8.26 to 8.85: the constraints keep noise out, and a
convex programme finds their global optimum. The level follows the noise, a tenth of the forces
(ours), and the Stribeck parameters, which the chapter does not print.";

pub(crate) const TABLE_4: &str = "\
Least squares and the feasible fits are alike here, where the chapter's feasible fits are twice
as far off as its least squares: not reproduced. The stand-in has the structure of the model and
the convex programme ends at its global optimum; the actual robot need not have the first, and a
local search need not do the second. Nonlinear friction is better than linear where it was
identified, and about even on the others, better on some and worse on others, where the chapter
has it better on all. The slow trajectory is the worst: its forces are small, and mostly friction
near standstill.";

pub(crate) const TABLE_5: &str = "\
As in the chapter, Coulomb friction by sign cannot be told from the weights that the legs carry:
one coefficient is far too high and the other far too low or negative, by the same amount, while
their sum is right; viscous friction is certain.";

pub(crate) const TABLE_6: &str = "\
The shape is the chapter's: few of Model 1's 37 are identified, twelve of Models 2, 3 and 4, nine
of friction and drives and three of the platform; eps_RA grows from model to model by little
while eps_AV falls by much. With symmetric friction Model 1 has twelve of 34 too, where the text
says four: not reproduced; our trajectories are better conditioned. eps_RA is a sum of sizes and the fit one of
squares, so that it can fall by a little with fewer parameters, in few seeds from 37 to 24. At the
noise that makes eps_RA the chapter's, ten to twelve are identified. eps_AV is taken over the
parameters that are not zero, as a fraction; small exact values of poorly identified parameters
dominate it, and in Model 4 none is left.";

pub(crate) const TABLES_7_AND_8: &str = "\
With drives, control, Stribeck friction and differentiated encoders the residual is model error,
as on the chapter's robot and at its level. Nine parameters are well identified in each of Models
2 to 4, where the chapter's have 9, 12 and 12. As there, Model 4 has the signs and sizes of CAD,
and Model 1 is far from it and not of any robot that can be built.";
