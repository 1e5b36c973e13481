/* See engine.h. A shared library for Unity and OpenXR programs:
 *
 *   cc -O2 -shared -fPIC -Iinclude examples/engine.c -L../../target/release -lpegfit_c -lm \
 *      -o libpegfit_engine.so
 */
#include "engine.h"

#include <math.h>
#include <stddef.h>

#include "pegfit.h"

/* Rows: the scene's x, y and z in the engine's axes. */
static const double AXES[2][3][3] = {
    {{1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
    {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
};

/* -1 where the engine's axes are a left hand: turns and torques change their sign. */
static const double HAND[2] = {-1, 1};

/* Columns and rows that are this far from unit length or from a right angle are no rotation. */
static const double TOLERANCE = 1e-3;

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

uint64_t engine_load(const char *path) {
    PegfitTable table = 0;
    pegfit_table_load(path, 0, &table);
    return table;
}

void engine_close(uint64_t table) {
    pegfit_table_close(table);
}

void engine_matrix(const float position[3], const float rotation[4], double matrix[16]) {
    double x = rotation[0], y = rotation[1], z = rotation[2], w = rotation[3];
    double rows[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)},
    };
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            matrix[4 * i + j] = rows[i][j];
        matrix[4 * i + 3] = position[i];
        matrix[12 + i] = 0;
    }
    matrix[15] = 1;
}

/* Whether rows are orthonormal and a right hand; false for numbers that are not finite. */
static int is_rotation(double m[3][3]) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j <= i; j++)
            if (!(fabs(dot(m[i], m[j]) - (i == j)) <= TOLERANCE))
                return 0;
    double cross[3] = {m[0][1] * m[1][2] - m[0][2] * m[1][1],
                       m[0][2] * m[1][0] - m[0][0] * m[1][2],
                       m[0][0] * m[1][1] - m[0][1] * m[1][0]};
    return dot(cross, m[2]) > 0;
}

/* x, y, z, w of a rotation, from its greatest component: no division by a small number. */
static void quaternion(double m[3][3], double q[4]) {
    double square[4] = {1 + m[0][0] - m[1][1] - m[2][2], 1 - m[0][0] + m[1][1] - m[2][2],
                        1 - m[0][0] - m[1][1] + m[2][2], 1 + m[0][0] + m[1][1] + m[2][2]};
    int most = 0;
    for (int k = 1; k < 4; k++)
        if (square[k] > square[most])
            most = k;
    double twice[4][4] = {
        {square[0], m[1][0] + m[0][1], m[0][2] + m[2][0], m[2][1] - m[1][2]},
        {m[1][0] + m[0][1], square[1], m[2][1] + m[1][2], m[0][2] - m[2][0]},
        {m[0][2] + m[2][0], m[2][1] + m[1][2], square[2], m[1][0] - m[0][1]},
        {m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1], square[3]},
    };
    double length = 0;
    for (int k = 0; k < 4; k++)
        length += twice[most][k] * twice[most][k];
    for (int k = 0; k < 4; k++)
        q[k] = twice[most][k] / sqrt(length);
}

int32_t engine_query(uint64_t table, int32_t axes, const double matrix[16],
                     EngineResponse *response) {
    if (matrix == NULL || response == NULL)
        return PEGFIT_STATUS_BAD_POINTER;
    if (axes != ENGINE_UNITY && axes != ENGINE_OPENXR)
        return PEGFIT_STATUS_BAD_POSE;
    const double(*to_engine)[3] = AXES[axes];
    double engine[3][3], scene[3][3];
    PegfitPose pose;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            engine[i][j] = matrix[4 * i + j];
        double at[3] = {matrix[3], matrix[7], matrix[11]};
        pose.translation[i] = dot(to_engine[i], at);
    }
    if (!is_rotation(engine))
        return PEGFIT_STATUS_BAD_POSE;
    /* The same rotation along the scene's axes: A R A^T, proper whichever hand A has. */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            scene[i][j] = 0;
            for (int k = 0; k < 3; k++)
                scene[i][j] += to_engine[i][k] * dot(engine[k], to_engine[j]);
        }
    quaternion(scene, pose.rotation);

    PegfitResponse found;
    PegfitStatus status = pegfit_table_query(table, &pose, &found);
    if (status != PEGFIT_STATUS_OK)
        return status;
    response->energy = found.energy;
    response->coverage = found.coverage;
    for (int j = 0; j < 3; j++) {
        response->force[j] = response->torque[j] = 0;
        for (int i = 0; i < 3; i++) {
            response->force[j] += to_engine[i][j] * found.force[i];
            response->torque[j] += HAND[axes] * to_engine[i][j] * found.torque[i];
        }
    }
    return PEGFIT_STATUS_OK;
}
