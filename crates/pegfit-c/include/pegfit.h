/* Energy tables of pegfit for C and C++; see docs/c-api.md.
 *
 * Lengths are metres, forces newtons, torques newton metres, energies joules. Every function may
 * be called from any thread. Written by cbindgen from crates/pegfit-c: do not edit.
 */

#ifndef PEGFIT_H
#define PEGFIT_H

#include <stddef.h>
#include <stdint.h>

/*
 How a call ended.
 */
typedef enum {
  /*
   It did what it says.
   */
  PEGFIT_STATUS_OK = 0,
  /*
   A pointer is null, not aligned, or two arrays overlap.
   */
  PEGFIT_STATUS_BAD_POINTER = 1,
  /*
   A number of elements or bytes is larger than memory can be.
   */
  PEGFIT_STATUS_BAD_SIZE = 2,
  /*
   A pose has a number that is not finite or a quaternion that is not of unit length.
   */
  PEGFIT_STATUS_BAD_POSE = 3,
  /*
   The path is not UTF-8.
   */
  PEGFIT_STATUS_BAD_PATH = 4,
  /*
   No table has this handle: it was closed, or never opened.
   */
  PEGFIT_STATUS_NO_SUCH_TABLE = 5,
  /*
   The table cannot be read: it is missing, incomplete, damaged or too large for the limit.
   */
  PEGFIT_STATUS_CANNOT_LOAD = 6,
  /*
   A mistake in pegfit itself.
   */
  PEGFIT_STATUS_INTERNAL = 7,
} PegfitStatus;

/*
 A loaded table. 0 is never one.
 */
typedef uint64_t PegfitTable;

/*
 Pose of the moving part in the scene that a table was baked for: what the scene puts at `q` is
 at `R q + t`. Without a placement these are the frames of both parts.
 */
typedef struct {
  /*
   t: x, y, z in metres.
   */
  double translation[3];
  /*
   R as a unit quaternion: x, y, z, w.
   */
  double rotation[4];
} PegfitPose;

/*
 What a table covers.
 */
typedef struct {
  /*
   Point of the moving part (its own frame, metres) whose displacement the window counts.
   */
  double pivot[3];
  /*
   Least displacement of the pivot, metres, along the axes of the fixed part's own frame, from
   where it is when both frames coincide.
   */
  double window_min[3];
  /*
   Greatest displacement.
   */
  double window_max[3];
  /*
   Rotation nodes.
   */
  uint64_t rotations;
  /*
   Bytes of energies in memory.
   */
  uint64_t bytes;
  /*
   Where the fixed part's own frame is in the scene that the table was baked for.
   */
  PegfitPose fixed;
  /*
   Where the moving part's own frame is there at the pose that is the identity.
   */
  PegfitPose moving;
} PegfitTableInfo;

/*
 Energy and wrench at a pose, along the scene's axes.
 */
typedef struct {
  /*
   Joules.
   */
  double energy;
  /*
   Torque on the moving part about where the pose takes the scene's origin: x, y, z in newton
   metres.
   */
  double torque[3];
  /*
   Force on the moving part: x, y, z in newtons.
   */
  double force[3];
  /*
   1 inside the table, 0 outside, where force and torque are 0; in between at its edge.
   */
  double coverage;
} PegfitResponse;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 What a status means, in English. Any number will do. The text is constant: do not free it.
 */
const char *pegfit_status_message(int32_t status);

/*
 The version of the library, such as "0.1.0". The text is constant: do not free it.
 */
const char *pegfit_version(void);

/*
 Writes what the calling thread's last failed call says, with names and numbers, to `buffer` of
 `size` bytes: as much as fits, ended by a zero. Returns the bytes that all of it needs, zero
 included; 1 if no call of this thread failed yet. `buffer` may be null if `size` is 0.

 # Safety
 `buffer` must be null or point to `size` bytes that may be written.
 */
size_t pegfit_last_error(char *buffer, size_t size);

/*
 Reads all of a baked table into memory, `memory_limit` bytes at most (0: no limit), and writes
 its handle to `table`. `path` is the table's folder, UTF-8, ended by a zero. On failure `table`
 is set to 0. Works in the child of a fork as well, if no other thread was in the middle of loading or
 closing a table at that moment.

 # Safety
 `path` must be null or end with a zero; `table` must be null or writable.
 */
PegfitStatus pegfit_table_load(const char *path,
                               uint64_t memory_limit,
                               PegfitTable *table);

/*
 Writes what a table covers to `info`.

 # Safety
 `info` must be null or writable.
 */
PegfitStatus pegfit_table_info(PegfitTable handle, PegfitTableInfo *info);

/*
 Writes energy, torque and force at `pose` to `response`. Takes microseconds, allocates nothing
 unless it fails, and waits for nobody but a thread that is opening or closing a table.

 # Safety
 `pose` must be null or readable, `response` null or writable.
 */
PegfitStatus pegfit_table_query(PegfitTable handle,
                                const PegfitPose *pose,
                                PegfitResponse *response);

/*
 [`pegfit_table_query`] at `count` poses, one after the other on the calling thread. If a pose is
 refused, the responses before it are written and those from it on are left alone. The arrays must
 not overlap; both may be null if `count` is 0.

 # Safety
 `poses` must be null or `count` readable poses, `responses` null or `count` writable responses.
 */
PegfitStatus pegfit_table_query_many(PegfitTable handle,
                                     const PegfitPose *poses,
                                     PegfitResponse *responses,
                                     size_t count);

/*
 Gives a table up. Queries that other threads are in the middle of end well; the memory is freed
 by the last of them. The handle is never used again.
 */
PegfitStatus pegfit_table_close(PegfitTable table);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PEGFIT_H */
