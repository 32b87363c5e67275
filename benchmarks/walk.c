/* Plays signals to the law of cmac_walk.c, for benchmarks/law.py. */
#include "cmac_walk.h"

#include <string.h>

static cmac_walk_state state;

void load(void) { cmac_walk_load(&state); }

int64_t count_signals(void) { return sizeof(cmac_walk_signals) / sizeof(double); }

int64_t count_commands(void) { return sizeof(cmac_walk_command) / sizeof(double); }

int64_t count_bytes(void) { return sizeof state; }

/* Commands that answer signals: how many differ from those expected. */
int64_t play(const double *signals, const double *expected, int64_t steps)
{
    int64_t wrong = 0;
    for (int64_t k = 0; k < steps; k++) {
        cmac_walk_signals now;
        cmac_walk_command command;
        memcpy(&now, signals + k * count_signals(), sizeof now);
        wrong += cmac_walk_step(&state, &now, &command) != 0
            || memcmp(&command, expected + k * count_commands(), sizeof command) != 0;
    }
    return wrong;
}

/* How many weights have other bits. */
int64_t compare_weights(const double *expected)
{
    const double *weights = state.network.weights[0][0];
    int64_t wrong = 0;
    for (size_t n = 0; n < sizeof state.network.weights / sizeof(double); n++) {
        wrong += memcmp(&weights[n], &expected[n], sizeof(double)) != 0;
    }
    return wrong;
}
