/* The loop of one leg in plain C: the arithmetic of cmacexp/loop/step.py for scenario=one_leg with learning.lead,
 * function by function, but for one thing: the rows of the CMAC are hashed anew in every step instead of being looked up
 * in a table. benchmarks/c_loop.py builds it with -ffast-math, so it rounds otherwise, and a run must not diverge. */

#include <stdint.h>

#ifndef LAYERS
#define LAYERS 32
#endif
#ifndef INPUTS
#define INPUTS 6
#endif
enum { COLUMNS = 16, REFERENCES = 6, OUTPUTS = 2, MOST_LEAD = 30, RECENT = 32 };
static const double GRAVITY = 9.81, FASTEST_JOINT = 100.0, PI = 3.14159265358979323846;

/* What does not change during a run; the same fields in the same order as benchmarks/c_loop.py has them. */
typedef struct {
    double length_1, length_2, mass_1, mass_2, hip_height, stiffness, step;
    double position_gain, velocity_gain, elasticity, admittance, b0, b1, a1, torque_limit, rate;
    int64_t period, start_step, resolution_elements, rows, seed, lead;
    const uint8_t *support;   /* (period) */
    const double *reference;  /* (2, period, REFERENCES) */
    const double *inputs;     /* (period, INPUTS) */
    const double *low, *high; /* (INPUTS) */
    const int64_t *shift;     /* (LAYERS, INPUTS) */
    double *weights;          /* (rows, OUTPUTS) */
} Law;

/* What changes; starts as the plant was reset, with the rest zero. */
typedef struct {
    double q[2], dq[2], foot[2], velocity[2], force, error[2], output[2], taught[2];
    int64_t taken;
} State;

typedef struct { double s1, c1, s12, c12; } Trig;

/* cmacexp/models/sine.py, as turn(): sine and cosine without the C library, the same terms in the same order. */
static void sine_cosine(double angle, double *sine, double *cosine) {
    const double s3 = -1.0 / 6, s5 = 1.0 / 120, s7 = -1.0 / 5040, s9 = 1.0 / 362880, s11 = -1.0 / 39916800,
                 s13 = 1.0 / 6227020800.0, s15 = -1.0 / 1307674368000.0;
    const double c4 = 1.0 / 24, c6 = -1.0 / 720, c8 = 1.0 / 40320, c10 = -1.0 / 3628800, c12 = 1.0 / 479001600,
                 c14 = -1.0 / 87178291200.0, c16 = 1.0 / 20922789888000.0;
    double quarters = __builtin_rint(angle * (2.0 / PI));
    double x = (angle - quarters * 1.57079632673412561417) - quarters * 6.07710050650619224932e-11;
    double x2 = x * x, x4 = x2 * x2, x8 = x4 * x4;
    double s = x + x * x2 * (((s3 + x2 * s5) + x4 * (s7 + x2 * s9)) + x8 * ((s11 + x2 * s13) + x4 * s15));
    double c = 1.0 - (0.5 * x2 - x4 * (((c4 + x2 * c6) + x4 * (c8 + x2 * c10)) + x8 * ((c12 + x2 * c14) + x4 * c16)));
    int64_t turned = (int64_t)quarters;
    if (turned & 1) {
        double swapped = s;
        s = c;
        c = -swapped;
    }
    *sine = turned & 2 ? -s : s;
    *cosine = turned & 2 ? -c : c;
}

static Trig trigonometry(const double *q) {
    Trig t;
    sine_cosine(q[0], &t.s1, &t.c1);
    sine_cosine(q[0] + q[1], &t.s12, &t.c12);
    return t;
}

static void turn(double *sine, double *cosine, double by) {
    const double s3 = -1.0 / 6, s5 = 1.0 / 120, s7 = -1.0 / 5040, c4 = 1.0 / 24, c6 = -1.0 / 720, c8 = 1.0 / 40320;
    double x2 = by * by, s0 = *sine, c0 = *cosine;
    double s = by + by * x2 * (s3 + x2 * (s5 + x2 * s7));
    double lost = x2 * (0.5 - x2 * (c4 + x2 * (c6 + x2 * c8)));
    *sine = s0 + (c0 * s - s0 * lost);
    *cosine = c0 - (s0 * s + c0 * lost);
}

static Trig turned_trigonometry(const double *q, Trig near, const double *near_q) {
    double by_1 = q[0] - near_q[0], by_12 = by_1 + (q[1] - near_q[1]);
    if (!(__builtin_fabs(by_1) <= 0.0625 && __builtin_fabs(by_12) <= 0.0625)) return trigonometry(q);
    turn(&near.s1, &near.c1, by_1);
    turn(&near.s12, &near.c12, by_12);
    return near;
}

static void jacobian(const Law *law, Trig t, double j[4]) {
    j[1] = -law->length_2 * t.s12;
    j[3] = law->length_2 * t.c12;
    j[0] = -law->length_1 * t.s1 + j[1];
    j[2] = law->length_1 * t.c1 + j[3];
}

static void joint_torque(const Law *law, Trig t, double fx, double fy, double *tau) {
    double j[4];
    jacobian(law, t, j);
    tau[0] = j[0] * fx + j[2] * fy;
    tau[1] = j[1] * fx + j[3] * fy;
}

static void contact(const Law *law, Trig t, double *foot, double *force) {
    foot[0] = law->length_1 * t.c1 + law->length_2 * t.c12;
    foot[1] = law->length_1 * t.s1 + law->length_2 * t.s12;
    double depression = foot[1] - law->hip_height;
    *force = depression > 0.0 ? law->stiffness * depression : 0.0;
}

static void accelerate(const Law *law, Trig t, const double *dq, const double *tau, double force, double *ddq) {
    double l1 = law->length_1, l2 = law->length_2, m1 = law->mass_1, m2 = law->mass_2, against[2];
    double m22 = l2 * l2 * m2;
    double m12 = m22 + l1 * l2 * m2 * (t.c1 * t.c12 + t.s1 * t.s12);
    double m11 = 2.0 * m12 - m22 + l1 * l1 * (m1 + m2);
    double coupling = m2 * l1 * l2 * (t.s12 * t.c1 - t.c12 * t.s1);
    double weight_2 = m2 * l2 * t.c12 * GRAVITY, weight_1 = (m1 + m2) * l1 * t.c1 * GRAVITY;
    double bias_1 = -coupling * (dq[1] * dq[1] + 2.0 * dq[0] * dq[1]) - weight_2 - weight_1;
    double bias_2 = coupling * dq[0] * dq[0] - weight_2;
    joint_torque(law, t, 0.0, force, against);
    double net_1 = tau[0] - bias_1 - against[0], net_2 = tau[1] - bias_2 - against[1];
    double determinant = m11 * m22 - m12 * m12;
    ddq[0] = (m22 * net_1 - m12 * net_2) / determinant;
    ddq[1] = (m11 * net_2 - m12 * net_1) / determinant;
}

/* One classical Runge-Kutta step; trig is that of the joints before and after it. */
static void advance(const Law *law, State *s, Trig *trig, const double *tau) {
    double h = law->step, q[2], dq[2], foot[2], force, k[4][2], j[4];
    Trig t;
    accelerate(law, *trig, s->dq, tau, s->force, k[0]);
    for (int i = 0; i < 2; i++) q[i] = s->q[i] + 0.5 * h * s->dq[i], dq[i] = s->dq[i] + 0.5 * h * k[0][i];
    t = turned_trigonometry(q, *trig, s->q);
    contact(law, t, foot, &force);
    accelerate(law, t, dq, tau, force, k[1]);
    for (int i = 0; i < 2; i++) q[i] = s->q[i] + 0.5 * h * dq[i], dq[i] = s->dq[i] + 0.5 * h * k[1][i];
    t = turned_trigonometry(q, *trig, s->q);
    contact(law, t, foot, &force);
    accelerate(law, t, dq, tau, force, k[2]);
    for (int i = 0; i < 2; i++) q[i] = s->q[i] + h * dq[i], dq[i] = s->dq[i] + h * k[2][i];
    t = turned_trigonometry(q, *trig, s->q);
    contact(law, t, foot, &force);
    accelerate(law, t, dq, tau, force, k[3]);
    for (int i = 0; i < 2; i++) {
        s->q[i] += h * s->dq[i] + h * h / 6.0 * (k[0][i] + k[1][i] + k[2][i]);
        s->dq[i] += h / 6.0 * (k[0][i] + 2.0 * k[1][i] + 2.0 * k[2][i] + k[3][i]);
    }
    *trig = trigonometry(s->q);
    contact(law, *trig, s->foot, &s->force);
    jacobian(law, *trig, j);
    s->velocity[0] = j[0] * s->dq[0] + j[1] * s->dq[1];
    s->velocity[1] = j[2] * s->dq[0] + j[3] * s->dq[1];
}

static uint32_t mix(uint32_t state, uint32_t value) {
    state = (state ^ value) * 0x5BD1E995u;
    return state ^ (state >> 15);
}

static void address(const Law *law, int64_t sample, int32_t *cells) {
    int64_t quanta = (law->resolution_elements - 1) * LAYERS;
    uint32_t quantum[INPUTS];
    for (int d = 0; d < INPUTS; d++) {
        double value = law->inputs[sample * INPUTS + d], low = law->low[d], high = law->high[d];
        double inside = value < low ? low : value > high ? high : value;
        int64_t at = (int64_t)__builtin_floor((inside - low) / (high - low) * (double)quanta);
        quantum[d] = (uint32_t)(at < quanta ? at : quanta - 1);
    }
    for (int j = 0; j < LAYERS; j++) {
        uint32_t state = mix(mix((uint32_t)law->seed, (uint32_t)j), INPUTS);
        for (int d = 0; d < INPUTS; d++)
            state = mix(state, (quantum[d] + (uint32_t)law->shift[j * INPUTS + d]) / LAYERS);
        cells[j] = (int32_t)(((uint64_t)mix(state, 0) * (uint64_t)law->rows) >> 32);
    }
}

static void train(const Law *law, const int32_t *cells, const double *error) {
    for (int o = 0; o < OUTPUTS; o++) {
        double share = law->rate * error[o] / LAYERS;
        for (int j = 0; j < LAYERS; j++) law->weights[cells[j] * OUTPUTS + o] += share;
    }
}

static void read_out(const Law *law, const int32_t *cells, double *output) {
    for (int o = 0; o < OUTPUTS; o++) {
        double total = 0.0;
        for (int j = 0; j < LAYERS; j++) total += law->weights[cells[j] * OUTPUTS + o];
        output[o] = total;
    }
}

static double lead_step(const Law *law, double error, double last_error, double last_output) {
    return law->b0 * error + law->b1 * last_error - law->a1 * last_output;
}

/* Combined force control along y in support, position control elsewhere; fills feedback and s->taught. */
static void feedback_step(const Law *law, State *s, Trig trig, int support, const double *r, double *feedback) {
    double y_error, u[2];
    double x_error = law->position_gain * (r[0] - s->foot[0]) + law->velocity_gain * (r[2] - s->velocity[0]);
    if (support)
        y_error = law->position_gain * (r[1] - s->foot[1] - s->force * law->elasticity)
                  + law->velocity_gain * (r[3] - s->velocity[1] - s->force * law->admittance);
    else
        y_error = law->position_gain * (r[1] - s->foot[1]) + law->velocity_gain * (r[3] - s->velocity[1]);
    u[0] = lead_step(law, x_error, s->error[0], s->output[0]);
    u[1] = lead_step(law, y_error, s->error[1], s->output[1]);
    s->error[0] = x_error, s->error[1] = y_error;
    s->output[0] = u[0], s->output[1] = u[1];
    joint_torque(law, trig, u[0], u[1], s->taught);
    if (r[5] != 0.0)
        joint_torque(law, trig, u[0], u[1] + r[5], feedback);
    else
        __builtin_memcpy(feedback, s->taught, sizeof s->taught);
}

static void saturate(double limit, double *feedback, double *feedforward, double *tau) {
    for (int j = 0; j < 2; j++) {
        double part = feedforward[j] < -limit ? -limit : feedforward[j];
        feedforward[j] = part > limit ? limit : part;
        double total = feedback[j] + feedforward[j];
        if (total > limit) feedback[j] = limit - feedforward[j];
        else if (total < -limit) feedback[j] = -limit - feedforward[j];
        tau[j] = feedback[j] + feedforward[j];
    }
}

static int has_diverged(const State *s) {
    for (int j = 0; j < 2; j++)
        if (!(__builtin_isfinite(s->q[j]) && __builtin_isfinite(s->foot[j]) && __builtin_fabs(s->dq[j]) <= FASTEST_JOINT)) return 1;
    return !__builtin_isfinite(s->force);
}

/* Run `steps` steps and write COLUMNS numbers of each; returns the steps taken before the leg diverged. */
int64_t one_leg(const Law *law, State *s, int64_t steps, double *samples) {
    int32_t cells[RECENT][LAYERS]; /* of the last steps, by their number */
    int known = 0;
    Trig trig = trigonometry(s->q);
    for (int64_t k = 0; k < steps; k++, s->taken++) {
        int64_t sample = s->taken % law->period;
        int learns = s->taken >= law->start_step;
        const double *r = law->reference + (learns * law->period + sample) * REFERENCES;
        double last[2] = {s->taught[0], s->taught[1]}, feedback[2], feedforward[2] = {0.0, 0.0}, tau[2];
        feedback_step(law, s, trig, law->support[sample], r, feedback);
        if (learns) {
            for (int64_t ago = law->lead + 1; ago > 0 && !known; ago--)
                address(law, (sample + law->period - ago) % law->period, cells[(s->taken - ago) & (RECENT - 1)]);
            known = 1;
            address(law, sample, cells[s->taken & (RECENT - 1)]);
            train(law, cells[(s->taken - 1 - law->lead) & (RECENT - 1)], last);
            read_out(law, cells[s->taken & (RECENT - 1)], feedforward);
        }
        saturate(law->torque_limit, feedback, feedforward, tau);
        double row[COLUMNS] = {
            r[0], r[1], s->foot[0], s->foot[1], s->velocity[0], s->velocity[1], s->q[0], s->q[1], s->dq[0], s->dq[1],
            s->force, s->force, feedback[0], feedback[1], feedforward[0], feedforward[1]};
        __builtin_memcpy(samples + k * COLUMNS, row, sizeof row);
        advance(law, s, &trig, tau);
        if (has_diverged(s)) return k + 1;
    }
    return steps;
}
