/**
 * @file stillpoint.h
 * The fixed-rate controller of Stillpoint as a C library, without allocation.
 *
 * Written by cbindgen from firmware/c/src; `cargo test -p stillpoint-c --test header` compares.
 *
 *     stillpoint_init          memory of the caller  -> a controller without a table
 *     stillpoint_load_table    bytes of a table file -> checked, decoded
 *     stillpoint_table         what the table is for: compare it with what is attached
 *     stillpoint_configure     settings              -> ready
 *     stillpoint_step          samples of a tick     -> command        once per period
 *     stillpoint_rearm         leaves SAFE, after somebody has looked
 *     stillpoint_release       the memory is the caller's again
 *
 * Units: `_ns` are nanoseconds of one monotonic clock that stamps all samples of a run, `_lu` is the unit of length of the
 * scene that the table was made for, `_lu_per_s` that per second.
 *
 * Errors: everything that may fail returns a StillpointStatus; stillpoint_last_error says more. Pointers are checked for
 * NULL and alignment. That they lead to memory of the right size, and that nobody else uses it meanwhile, is the caller's to
 * promise ("Safety" below).
 *
 * Threads and interrupts: different controllers are independent. Calls for the same one must not overlap; those that do
 * are refused (STILLPOINT_STATUS_BUSY).
 */

#ifndef STILLPOINT_H
#define STILLPOINT_H

#include <stddef.h>
#include <stdint.h>

/**
 * Version of this header: give it to `stillpoint_init`, which refuses any other.
 */
#define STILLPOINT_API_VERSION 1

/**
 * Bytes of memory that a controller needs at most, on every target; `stillpoint_memory_bytes()` are enough.
 */
#define STILLPOINT_MEMORY_BYTES 36864

/**
 * Alignment of that memory, bytes.
 */
#define STILLPOINT_MEMORY_ALIGNMENT 8

/**
 * `StillpointTargetSample.flags`: the sensor saw the target; without it the displacement means nothing.
 */
#define STILLPOINT_TARGET_VISIBLE 1

/**
 * `StillpointCommand.flags`: the displacement is to be executed. Without it the actuator keeps its position.
 */
#define STILLPOINT_COMMAND_VALID 1

/**
 * `StillpointInputs.arrived`: a needle sample has arrived since the last step.
 */
#define STILLPOINT_NEEDLE_ARRIVED 1

/**
 * `StillpointInputs.arrived`: a target sample has arrived since the last step.
 */
#define STILLPOINT_TARGET_ARRIVED 2

/**
 * `StillpointInputs.arrived`: a paddle sample has arrived since the last step.
 */
#define STILLPOINT_PADDLE_ARRIVED 4

/**
 * `StillpointCommand.mode`: the paddle keeps its position; RUN follows by itself when the reason is gone.
 */
#define STILLPOINT_MODE_HOLD 1

/**
 * `StillpointCommand.mode`: feed-forward and feedback act.
 */
#define STILLPOINT_MODE_RUN 2

/**
 * `StillpointCommand.mode`: the paddle keeps its position until `stillpoint_rearm`.
 */
#define STILLPOINT_MODE_SAFE 3

/**
 * `StillpointSettings.feedback`: every sample moves the paddle by a fixed part of the error; the fewest instructions.
 */
#define STILLPOINT_FEEDBACK_INTEGRAL 0

/**
 * `StillpointSettings.feedback`: what the table leaves is estimated and removed. The default.
 */
#define STILLPOINT_FEEDBACK_OBSERVER 1

/**
 * `StillpointSettings.feedback`: the observer, which predicts a patient's breaths as well.
 */
#define STILLPOINT_FEEDBACK_HARMONIC 2

/**
 * `StillpointSettings.direction`: moves the target orthogonally to the needle only. The default.
 */
#define STILLPOINT_DIRECTION_INVERSE 0

/**
 * `StillpointSettings.direction`: the shortest motion of the paddle; the target may move along the needle, too.
 */
#define STILLPOINT_DIRECTION_MINIMUM_NORM 1

/**
 * `StillpointSettings.position_limit`: the norm of the displacement is limited. The default.
 */
#define STILLPOINT_POSITION_LIMIT_NORM 0

/**
 * `StillpointSettings.position_limit`: each axis by itself, to the largest square inside the disc.
 */
#define STILLPOINT_POSITION_LIMIT_BOX 1

/**
 * Not armed: some input has never been heard, or the measured paddle position is not adopted yet. HOLD.
 */
#define STILLPOINT_FAULT_WAITING 1

/**
 * Needle sample older than its first limit. HOLD.
 */
#define STILLPOINT_FAULT_NEEDLE_STALE 2

/**
 * Target sample older than its first limit. HOLD.
 */
#define STILLPOINT_FAULT_TARGET_STALE 4

/**
 * Paddle sample older than its first limit. HOLD.
 */
#define STILLPOINT_FAULT_PADDLE_STALE 8

/**
 * The sensor does not see the target. HOLD.
 */
#define STILLPOINT_FAULT_TARGET_LOST 16

/**
 * Needle faster than the table holds for. HOLD.
 */
#define STILLPOINT_FAULT_NEEDLE_TOO_FAST 32

/**
 * The measured paddle moves: its position is not adopted. HOLD.
 */
#define STILLPOINT_FAULT_PADDLE_MOVING 64

/**
 * The measured paddle is further out than it may be commanded: its position is not adopted. HOLD.
 */
#define STILLPOINT_FAULT_PADDLE_BEYOND_LIMIT 128

/**
 * Needle sample older than its second limit. SAFE.
 */
#define STILLPOINT_FAULT_NEEDLE_DEAD 256

/**
 * Target sample older than its second limit. SAFE.
 */
#define STILLPOINT_FAULT_TARGET_DEAD 512

/**
 * Paddle sample older than its second limit. SAFE.
 */
#define STILLPOINT_FAULT_PADDLE_DEAD 1024

/**
 * The tick's time or number did not go on; the tick's inputs were not read. SAFE.
 */
#define STILLPOINT_FAULT_CLOCK_REVERSED 2048

/**
 * Too many ticks were preceded by skipped ones. SAFE.
 */
#define STILLPOINT_FAULT_OVERRUN 4096

/**
 * The paddle does not follow its commands. SAFE.
 */
#define STILLPOINT_FAULT_FOLLOWING_ERROR 8192

/**
 * Another paddle is attached than the table was made for. SAFE.
 */
#define STILLPOINT_FAULT_PADDLE_IDENTITY 16384

/**
 * The error grows although the controller acts: wrong sign, wrong table or wrong tissue. SAFE.
 */
#define STILLPOINT_FAULT_DIVERGENCE 32768

/**
 * The law gave a number that is not finite; not emitted. SAFE.
 */
#define STILLPOINT_FAULT_INTERNAL 65536

/**
 * The watchdog outside of the controller has taken over. SAFE; never set by the controller itself.
 */
#define STILLPOINT_FAULT_WATCHDOG 131072

/**
 * The tick's time and number went on by different amounts; the tick's inputs were not read. SAFE.
 */
#define STILLPOINT_FAULT_CLOCK_JUMPED 262144

/**
 * Depth outside the table, its nearest end is used. Goes on.
 */
#define STILLPOINT_FAULT_DEPTH_CLAMPED 16777216

/**
 * Command limited in position. Goes on.
 */
#define STILLPOINT_FAULT_POSITION_LIMITED 33554432

/**
 * Command limited in rate. Goes on.
 */
#define STILLPOINT_FAULT_RATE_LIMITED 67108864

/**
 * Sequence numbers of an input skipped some. Goes on.
 */
#define STILLPOINT_FAULT_SAMPLE_GAP 134217728

/**
 * An input arrived twice. Goes on.
 */
#define STILLPOINT_FAULT_DUPLICATE 268435456

/**
 * An input arrived after a newer one and was discarded. Goes on.
 */
#define STILLPOINT_FAULT_OUT_OF_ORDER 536870912

/**
 * An input with NaN, infinity or a subnormal was discarded. Goes on until stale.
 */
#define STILLPOINT_FAULT_NOT_FINITE 1073741824

/**
 * An implausible input was discarded (wrong units?). Goes on until stale.
 */
#define STILLPOINT_FAULT_OUT_OF_RANGE 2147483648

/**
 * An input from the future, or not after the one before it, was discarded. Goes on until stale.
 */
#define STILLPOINT_FAULT_SAMPLE_TIME 4294967296

/**
 * An input that jumped was discarded. Goes on until stale.
 */
#define STILLPOINT_FAULT_INNOVATION 8589934592

/**
 * An input whose value no longer changes was discarded. Goes on until stale.
 */
#define STILLPOINT_FAULT_FROZEN 17179869184

/**
 * Periods before this tick were skipped. Goes on until too many in a row.
 */
#define STILLPOINT_FAULT_TICKS_SKIPPED 34359738368

/**
 * What another code of this step says of a paddle, it says of the second one, at least. Never set in the plane.
 */
#define STILLPOINT_FAULT_SECOND_PADDLE 68719476736

/**
 * What became of a call. 0 is success; `stillpoint_status_text` says what to do about the others. Numbers are never
 * reused.
 */
enum StillpointStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  /**
   * Done.
   */
  STILLPOINT_STATUS_OK = 0,
  /**
   * A pointer is NULL.
   */
  STILLPOINT_STATUS_NULL_POINTER = 1,
  /**
   * A pointer is not aligned for what it points to.
   */
  STILLPOINT_STATUS_MISALIGNED = 2,
  /**
   * The memory is smaller than `stillpoint_memory_bytes()`.
   */
  STILLPOINT_STATUS_MEMORY_TOO_SMALL = 3,
  /**
   * The memory holds something: it must be zero before its first use.
   */
  STILLPOINT_STATUS_MEMORY_NOT_ZERO = 4,
  /**
   * The memory holds a controller already, which has not been released.
   */
  STILLPOINT_STATUS_IN_USE = 5,
  /**
   * Header and library are of different versions.
   */
  STILLPOINT_STATUS_API_VERSION = 6,
  /**
   * There is no controller at this address: never initialised, or released.
   */
  STILLPOINT_STATUS_NOT_INITIALISED = 7,
  /**
   * The controller has been copied or moved from where it was initialised.
   */
  STILLPOINT_STATUS_MOVED = 8,
  /**
   * Another call for this controller has not returned: an interrupt or a thread came between.
   */
  STILLPOINT_STATUS_BUSY = 9,
  /**
   * No table has been loaded.
   */
  STILLPOINT_STATUS_NO_TABLE = 10,
  /**
   * `stillpoint_configure` has not been called.
   */
  STILLPOINT_STATUS_NOT_CONFIGURED = 11,
  /**
   * The controller is configured: table and settings stay as they are until it is released.
   */
  STILLPOINT_STATUS_ALREADY_CONFIGURED = 12,
  /**
   * A number that chooses something is none of its constants, or a reserved field is not 0.
   */
  STILLPOINT_STATUS_UNKNOWN_OPTION = 13,
  /**
   * The settings contradict themselves or the table.
   */
  STILLPOINT_STATUS_INVALID_SETTINGS = 14,
  /**
   * Only SAFE needs re-arming.
   */
  STILLPOINT_STATUS_NOT_SAFE = 15,
  /**
   * The bytes are no controller table.
   */
  STILLPOINT_STATUS_NOT_A_TABLE = 20,
  /**
   * The table is of another version of the format.
   */
  STILLPOINT_STATUS_TABLE_VERSION = 21,
  /**
   * The table is damaged: too short, too long, or its checksum is wrong.
   */
  STILLPOINT_STATUS_TABLE_DAMAGED = 22,
  /**
   * The table holds other numbers than `f64`.
   */
  STILLPOINT_STATUS_TABLE_SCALAR = 23,
  /**
   * The table is not planar.
   */
  STILLPOINT_STATUS_TABLE_DIMENSION = 24,
  /**
   * The table is intact, but no controller may work with it.
   */
  STILLPOINT_STATUS_TABLE_INVALID = 25,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum StillpointStatus StillpointStatus;
#else
typedef uint32_t StillpointStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A controller; it lives in memory of the caller, who never looks inside, and never moves or copies it.
 */
typedef struct Stillpoint Stillpoint;

/**
 * What a loaded table is for: to be compared with what is attached.
 */
typedef struct StillpointTable {
  /**
   * SHA-256 of the scene that the table was made from.
   */
  uint8_t scene_hash[32];
  /**
   * What `_lu` means, as the scene calls it, for example "mm"; ends with 0.
   */
  char length_unit[24];
  /**
   * Number of the paddle.
   */
  uint32_t paddle_index;
  /**
   * Depths in the table.
   */
  uint32_t knots;
  /**
   * Largest norm of a commanded displacement.
   */
  double max_displacement_lu;
  /**
   * Largest norm of its rate.
   */
  double max_rate_lu_per_s;
  /**
   * Smallest depth of the needle in the table.
   */
  double depth_start_lu;
  /**
   * Largest depth of the needle in the table.
   */
  double depth_end_lu;
  /**
   * Fastest needle that the table holds for.
   */
  double needle_speed_lu_per_s;
  /**
   * Unit vector along the insertion, in the axes of the scene.
   */
  double needle_axis[2];
  /**
   * Rest position of the target in the scene.
   */
  double target_position_lu[2];
} StillpointTable;

/**
 * What may be chosen; `stillpoint_default_settings` fills it.
 */
typedef struct StillpointSettings {
  /**
   * Period of the loop, ns; at most 10 s.
   */
  uint64_t loop_period_ns;
  /**
   * Period of the target sensor, ns; at least that of the loop, at most 10 s.
   */
  uint64_t target_period_ns;
  /**
   * Longest time from the measurement of the target to its arrival, ns.
   */
  uint64_t target_latency_ns;
  /**
   * Time from a command to the paddle being there, ns.
   */
  uint64_t actuator_delay_ns;
  /**
   * Standard deviation of the target sensor per component; 0: unknown.
   */
  double target_noise_lu;
  /**
   * Loop gain per target sample, at most 2; 0: the one that follows from the delay of the loop.
   */
  double loop_gain;
  /**
   * How much stronger the tissue may answer than the table says, from 1 to 100; 0: the table's.
   */
  double lambda_max;
  /**
   * Admitted distance between measured and commanded paddle at rest; 0: 2 % of the paddle's range.
   */
  double following_error_lu;
  /**
   * One of `STILLPOINT_FEEDBACK_*`.
   */
  uint32_t feedback;
  /**
   * One of `STILLPOINT_DIRECTION_*`.
   */
  uint32_t direction;
  /**
   * One of `STILLPOINT_POSITION_LIMIT_*`.
   */
  uint32_t position_limit;
  /**
   * 0.
   */
  uint32_t reserved;
} StillpointSettings;

/**
 * The tip of the needle as measured, at the rate of the loop.
 */
typedef struct StillpointNeedleSample {
  /**
   * Counts the samples of this stream, from any number on; wraps.
   */
  uint32_t sequence;
  /**
   * 0.
   */
  uint32_t reserved;
  /**
   * Time of the measurement, ns.
   */
  uint64_t time_ns;
  /**
   * Depth of the insertion along the axis of the needle.
   */
  double depth_lu;
  /**
   * Rate of the depth.
   */
  double velocity_lu_per_s;
} StillpointNeedleSample;

/**
 * Displacement of the target from its rest position, at the rate of its sensor.
 */
typedef struct StillpointTargetSample {
  /**
   * Counts the samples of this stream, from any number on; wraps.
   */
  uint32_t sequence;
  /**
   * Set of `STILLPOINT_TARGET_VISIBLE`.
   */
  uint32_t flags;
  /**
   * Time of the measurement, not of its arrival, ns.
   */
  uint64_t time_ns;
  /**
   * x and y in the axes of the scene.
   */
  double displacement_lu[2];
} StillpointTargetSample;

/**
 * Where the paddle is, as measured by its actuator, at the rate of the loop.
 */
typedef struct StillpointPaddleSample {
  /**
   * Counts the samples of this stream, from any number on; wraps.
   */
  uint32_t sequence;
  /**
   * Number of the paddle that is attached; must be the table's.
   */
  uint32_t paddle_index;
  /**
   * Time of the measurement, ns.
   */
  uint64_t time_ns;
  /**
   * x and y from where the paddle touches the undeformed tissue, in the axes of the scene.
   */
  double displacement_lu[2];
} StillpointPaddleSample;

/**
 * What a step is given: the newest sample of each stream since the last one.
 */
typedef struct StillpointInputs {
  /**
   * Number of this release of the loop; skipped releases leave gaps.
   */
  uint64_t tick;
  /**
   * Time of this tick on the clock that stamps the samples, ns.
   */
  uint64_t time_ns;
  /**
   * Newest needle sample, if `STILLPOINT_NEEDLE_ARRIVED`.
   */
  struct StillpointNeedleSample needle;
  /**
   * Newest target sample, if `STILLPOINT_TARGET_ARRIVED`.
   */
  struct StillpointTargetSample target;
  /**
   * Newest paddle sample, if `STILLPOINT_PADDLE_ARRIVED`.
   */
  struct StillpointPaddleSample paddle;
  /**
   * Set of `STILLPOINT_*_ARRIVED`; what has not arrived is not read.
   */
  uint32_t arrived;
  /**
   * 0.
   */
  uint32_t reserved;
} StillpointInputs;

/**
 * Where the paddle shall be: one per step, in every mode.
 */
typedef struct StillpointCommand {
  /**
   * Counts the commands; wraps.
   */
  uint32_t sequence;
  /**
   * One of `STILLPOINT_MODE_*`.
   */
  uint32_t mode;
  /**
   * The step's.
   */
  uint64_t tick;
  /**
   * The step's, ns.
   */
  uint64_t time_ns;
  /**
   * Set of `STILLPOINT_FAULT_*`.
   */
  uint64_t faults;
  /**
   * x and y of the paddle; to be executed only with `STILLPOINT_COMMAND_VALID`.
   */
  double displacement_lu[2];
  /**
   * Of the newest needle sample that was used.
   */
  uint32_t needle_sequence;
  /**
   * Of the newest target sample that was used.
   */
  uint32_t target_sequence;
  /**
   * Number of the paddle that the command is for.
   */
  uint32_t paddle_index;
  /**
   * Set of `STILLPOINT_COMMAND_VALID`.
   */
  uint32_t flags;
} StillpointCommand;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Version of the library as a text, for example "0.1.0".
 */
const char *stillpoint_version(void);

/**
 * Version of the interface: `STILLPOINT_API_VERSION` of the header that belongs to this library.
 */
uint32_t stillpoint_api_version(void);

/**
 * Bytes of memory that a controller needs; at most `STILLPOINT_MEMORY_BYTES`.
 */
size_t stillpoint_memory_bytes(void);

/**
 * Alignment of that memory, bytes; at most `STILLPOINT_MEMORY_ALIGNMENT`.
 */
size_t stillpoint_memory_alignment(void);

/**
 * What a status means and what to do about it, in English. Never NULL; for a number that is no status, it says so.
 */
const char *stillpoint_status_text(uint32_t status);

/**
 * Name of a mode: "HOLD", "RUN" or "SAFE"; "?" for any other number.
 */
const char *stillpoint_mode_name(uint32_t mode);

/**
 * Writes the names of a set of faults, as "TARGET_LOST | OVERRUN", or "NONE".
 *
 * As `snprintf`: writes at most `text_bytes` bytes with a 0 at the end, and returns the length of the whole text without
 * it. `text` may be NULL.
 *
 * # Safety
 * `text_bytes` bytes may be written to `text`.
 */
size_t stillpoint_fault_names(uint64_t faults,
                              char *text,
                              size_t text_bytes);

/**
 * Makes a controller in `memory` and writes its address, which is that of the memory, to `controller`. It has no table yet.
 *
 * The memory must be zero before its first use, as static memory is. Until `stillpoint_release` it is the controller's:
 * not to be written, copied or moved. On failure `controller` is set to NULL.
 *
 * @param api_version `STILLPOINT_API_VERSION`
 *
 * # Safety
 * `memory_bytes` bytes may be read and written at `memory`; nobody else uses them until the release.
 */
StillpointStatus stillpoint_init(void *memory,
                                 size_t memory_bytes,
                                 uint32_t api_version,
                                 struct Stillpoint **controller);

/**
 * Ends a controller: its memory is the caller's again, and may be given to `stillpoint_init` as it is.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`.
 */
StillpointStatus stillpoint_release(struct Stillpoint *controller);

/**
 * Checks and decodes a table: the bytes of a file as `model-offline table` writes it, which are not needed afterwards.
 *
 * A table that is refused leaves the controller without one. Not after `stillpoint_configure`.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`; `table_bytes` bytes may be read at `table`.
 */
StillpointStatus stillpoint_load_table(struct Stillpoint *controller, const uint8_t *table, size_t table_bytes);

/**
 * Tells what the loaded table is for. Compare it with what is attached before anything moves: the unit of length most of
 * all, which no check can know.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`; a struct may be written to `table`.
 */
StillpointStatus stillpoint_table(struct Stillpoint *controller,
                                  struct StillpointTable *table);

/**
 * Fills in the settings for a loop and a target sensor with these periods and this latency; everything else has its
 * default, and may be changed afterwards.
 *
 * @param loop_period_ns period of the loop, ns
 * @param target_period_ns period of the target sensor, ns
 * @param target_latency_ns longest time from the measurement of the target to its arrival, ns
 *
 * # Safety
 * A struct may be written to `settings`.
 */
StillpointStatus stillpoint_default_settings(uint64_t loop_period_ns,
                                             uint64_t target_period_ns,
                                             uint64_t target_latency_ns,
                                             struct StillpointSettings *settings);

/**
 * Checks the settings, and makes the controller ready for its first step. Once per controller.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`; `settings` leads to a struct.
 */
StillpointStatus stillpoint_configure(struct Stillpoint *controller, const struct StillpointSettings *settings);

/**
 * One tick: checks the inputs, decides the mode, and gives the command for the paddle. Once per period of the loop, also
 * when nothing has arrived.
 *
 * If it fails, `command` (unless it is NULL or misaligned) says SAFE and has nothing to execute.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`; `inputs` leads to a struct, and a struct may be written to `command`.
 */
StillpointStatus stillpoint_step(struct Stillpoint *controller,
                                 const struct StillpointInputs *inputs,
                                 struct StillpointCommand *command);

/**
 * Leaves SAFE, after somebody has looked: the paddle's measured position is adopted once more.
 *
 * # Safety
 * `controller` comes from `stillpoint_init`.
 */
StillpointStatus stillpoint_rearm(struct Stillpoint *controller);

/**
 * Writes why the last call for this controller failed and what to do, with the numbers that `stillpoint_status_text` does
 * not know; nothing if it did not fail.
 *
 * As `snprintf`: writes at most `text_bytes` bytes with a 0 at the end, and returns the length of the whole text without
 * it. `text` may be NULL. Of a pointer that is no controller it tells that.
 *
 * # Safety
 * `controller` is NULL or comes from `stillpoint_init`; `text_bytes` bytes may be written to `text`.
 */
size_t stillpoint_last_error(struct Stillpoint *controller,
                             char *text,
                             size_t text_bytes);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* STILLPOINT_H */
