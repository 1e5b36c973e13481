/* The example for Unity and OpenXR: forces and torques are minus the slopes of the energy over motions
 * that the engine itself would make, and mirrored, scaled or missing poses are refused.
 *
 *   engine TABLE.zarr HOME_X HOME_Y HOME_Z    (the scene's axes, metres)
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/engine.c"

static void expect(int right, const char *what, int32_t axes) {
    if (right)
        return;
    fprintf(stderr, "axes %d: %s\n", axes, what);
    exit(1);
}

static double energy(uint64_t table, int32_t axes, const double matrix[16]) {
    EngineResponse at;
    expect(engine_query(table, axes, matrix, &at) == 0 && at.coverage > 0, "no energy", axes);
    return at.energy;
}

/* The matrix after a turn about axis k through its translation, as AngleAxis of either engine. */
static void turn(const double from[16], int k, double angle, double to[16]) {
    int a = (k + 1) % 3, b = (k + 2) % 3;
    memcpy(to, from, 16 * sizeof *to);
    for (int j = 0; j < 3; j++) {
        to[4 * a + j] = cos(angle) * from[4 * a + j] - sin(angle) * from[4 * b + j];
        to[4 * b + j] = sin(angle) * from[4 * a + j] + cos(angle) * from[4 * b + j];
    }
}

static void check_slopes(uint64_t table, int32_t axes, const double matrix[16]) {
    EngineResponse at;
    expect(engine_query(table, axes, matrix, &at) == 0, "the pose is refused", axes);
    double force = 0, torque = 0;
    for (int k = 0; k < 3; k++) {
        double step = 1e-5, ahead[16], behind[16];
        memcpy(ahead, matrix, sizeof ahead);
        memcpy(behind, matrix, sizeof behind);
        ahead[4 * k + 3] += step;
        behind[4 * k + 3] -= step;
        double slope = (energy(table, axes, ahead) - energy(table, axes, behind)) / (2 * step);
        expect(fabs(at.force[k] + slope) < 1e-5, "force and slope differ", axes);
        step = 1e-4;
        turn(matrix, k, step, ahead);
        turn(matrix, k, -step, behind);
        slope = (energy(table, axes, ahead) - energy(table, axes, behind)) / (2 * step);
        expect(fabs(at.torque[k] + slope) < 1e-5, "torque and slope differ", axes);
        force += fabs(at.force[k]);
        torque += fabs(at.torque[k]);
    }
    expect(force > 0.1 && torque > 1e-3, "nothing was felt", axes);
}

static void check_refusals(uint64_t table, int32_t axes, const double matrix[16]) {
    EngineResponse at;
    for (int what = 0; what < 3; what++) {
        double bad[16];
        memcpy(bad, matrix, sizeof bad);
        for (int i = 0; i < 3; i++)
            bad[4 * i] *= what == 0 ? -1 : what == 1 ? 1.5 : (double)NAN;
        expect(engine_query(table, axes, bad, &at) == PEGFIT_STATUS_BAD_POSE, "taken", axes);
    }
    expect(engine_query(table, 2, matrix, &at) == PEGFIT_STATUS_BAD_POSE, "axes 2", axes);
    expect(engine_query(table, axes, NULL, &at) == PEGFIT_STATUS_BAD_POINTER, "no pose", axes);
    expect(engine_query(table + 1, axes, matrix, &at) == PEGFIT_STATUS_NO_SUCH_TABLE, "none", axes);
}

int main(int count, char **words) {
    if (count != 5)
        return 2;
    uint64_t table = engine_load(words[1]);
    double x = atof(words[2]), y = atof(words[3]), z = atof(words[4]);
    /* Two millimetres away from the bottom of the well along the scene's x and up along its z. */
    float places[2][3] = {{(float)(x + 2e-3), (float)(z + 1e-3), (float)y},
                          {(float)(x + 2e-3), (float)(z + 1e-3), (float)-y}};
    float rotation[4] = {0.02f, -0.03f, 0.01f, 0.9993f};
    for (int32_t axes = 0; axes < 2; axes++) {
        double matrix[16];
        expect(table != 0, "no table", axes);
        engine_matrix(places[axes], rotation, matrix);
        check_slopes(table, axes, matrix);
        check_refusals(table, axes, matrix);

        /* Upright, two millimetres along x and one up: the spring pulls back along x, and down. */
        float upright[4] = {0, 0, 0, 1};
        EngineResponse at;
        engine_matrix(places[axes], upright, matrix);
        expect(engine_query(table, axes, matrix, &at) == 0, "refused", axes);
        expect(fabs(at.force[0] + 0.2) < 0.02, "not back along x", axes);
        expect(fabs(at.force[1] + 0.1) < 0.02, "not down", axes);
        expect(fabs(at.force[2]) < 0.02, "sideways", axes);
    }
    engine_close(table);
    expect(engine_load("nowhere.zarr") == 0, "a table that is not there", 0);
    puts("slopes and refusals are right");
    return 0;
}
