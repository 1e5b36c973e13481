/* Forces of a table for game engines and XR runtimes: poses as row-major matrices along the axes of
 * Unity (left-handed, y up) or OpenXR (right-handed, y up), forces and torques along the same axes.
 *
 * No function here starts a thread, and none but `engine_load` and `engine_close` allocates: call
 * `engine_query` from FixedUpdate, a physics step, or a haptic thread of your own.
 */
#ifndef PEGFIT_ENGINE_H
#define PEGFIT_ENGINE_H

#include <stdint.h>

#ifdef _WIN32
#define ENGINE_API __declspec(dllexport)
#else
#define ENGINE_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Which axes a program has. In a scene of pegfit z is up; x, y, z of a scene are
 *   ENGINE_UNITY:  x, z, y of Unity;
 *   ENGINE_OPENXR: x, -z, y of OpenXR. */
typedef enum { ENGINE_UNITY = 0, ENGINE_OPENXR = 1 } EngineAxes;

/* What the moving part feels, along the engine's axes. */
typedef struct {
    double energy;    /* joules */
    double force[3];  /* newtons */
    double torque[3]; /* newton metres, about the matrix's translation; turns have the engine's sign */
    double coverage;  /* 1 inside the table, 0 outside */
} EngineResponse;

/* Reads a table; 0 if it cannot be read (`pegfit_last_error` says why). Call it before the loop. */
ENGINE_API uint64_t engine_load(const char *path);

/* Row-major matrix of a pose from a position in metres and a quaternion x, y, z, w: Unity's
 * Transform, or XrPosef. The handedness does not matter. */
ENGINE_API void engine_matrix(const float position[3], const float rotation[4], double matrix[16]);

/* Response at the pose of the moving part relative to the fixed one: 16 numbers, row by row, the
 * translation in metres at 3, 7 and 11. Returns a PegfitStatus: 0, or PEGFIT_STATUS_BAD_POSE for a
 * matrix that scales, mirrors or shears. */
ENGINE_API int32_t engine_query(uint64_t table, int32_t axes, const double matrix[16],
                                EngineResponse *response);

/* Gives the table up. */
ENGINE_API void engine_close(uint64_t table);

#ifdef __cplusplus
}
#endif

#endif
