/* Prints outputs of a robot's functions near home, relative to the largest of each function: a line
   has the function, the index and the number. */
#include <stdio.h>

#include "robot.h"

#define N ROBOT_COORDINATE_COUNT
#define DOF ROBOT_INDEPENDENT_COUNT
#define P ROBOT_PARAMETER_COUNT

static void show(const char *name, const double *values, int count)
{
    double largest = 0;
    for (int k = 0; k < count; k++) {
        const double size = values[k] < 0 ? -values[k] : values[k];
        largest = size > largest ? size : largest;
    }
    for (int k = 0; k < count; k++) {
        printf("%s %d %.17g\n", name, k, largest > 0 ? values[k] / largest : 0);
    }
}

static void show_f(const char *name, const float *values, int count)
{
    static double wide[DOF * P + N];
    for (int k = 0; k < count; k++) {
        wide[k] = (double)values[k];
    }
    show(name, wide, count);
}

int main(void)
{
    static double q[N], qd[N], qdd[N], phi[P], w[DOF * P], tau[DOF];
    static float q_f[N], qd_f[N], qdd_f[N], phi_f[P], w_f[DOF * P], tau_f[DOF];
    /* irregular numbers without a function of the C library, the same on every machine */
    unsigned state = 12345;
    for (int k = 0; k < 3 * N + P; k++) {
        state = state * 1103515245u + 12345u;
        const float number = (float)((state >> 8) & 0xffffu) / 65536.0f - 0.5f;
        if (k < N) {
            q_f[k] = (float)robot_home[k] + 0.1f * number;
            q[k] = (double)q_f[k];
        } else if (k < 2 * N) {
            qd_f[k - N] = number;
            qd[k - N] = (double)number;
        } else if (k < 3 * N) {
            qdd_f[k - 2 * N] = number;
            qdd[k - 2 * N] = (double)number;
        } else {
            phi_f[k - 3 * N] = number;
            phi[k - 3 * N] = (double)number;
        }
    }
    robot_regressor(q, qd, qdd, w);
    robot_inverse_dynamics(q, qd, qdd, phi, tau);
    robot_regressor_f(q_f, qd_f, qdd_f, w_f);
    robot_inverse_dynamics_f(q_f, qd_f, qdd_f, phi_f, tau_f);
    show("regressor", w, DOF * P);
    show("inverse_dynamics", tau, DOF);
    show_f("regressor_f", w_f, DOF * P);
    show_f("inverse_dynamics_f", tau_f, DOF);
    return 0;
}
