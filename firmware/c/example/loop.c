/*
 * A simulated insertion with the controller in C. Also C++. What a program with real hardware keeps of this: everything
 * but the tissue below.
 *
 *   cc -std=c11 -I firmware/c/include firmware/c/example/loop.c target/release/libstillpoint.a -o loop
 *   ./loop firmware/tests/planar.table
 *
 * With --bits, every command is printed with the bits of its numbers.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "stillpoint.h"

#define PERIOD_NS 1000000u /* 1 kHz */
#define TICKS 6000u
#define TARGET_TICKS 20u /* the target is seen at 50 Hz, and its sample arrives 20 ms later */

/* Where a controller lives: zero before its first use, aligned, never moved. */
static union {
  uint64_t alignment;
  unsigned char bytes[STILLPOINT_MEMORY_BYTES];
} memory;

/* A table has 64 KiB at most. */
static unsigned char table_file[64 * 1024];

/* Tissue that a real program does not have: a needle that goes in, a target that is pushed aside, an ideal paddle. */
typedef struct Tissue {
  double depth, speed, end;
  double paddle[2];
  uint32_t paddle_index;
  StillpointTargetSample late; /* on its way */
  int is_late;
} Tissue;

static void target_of(const Tissue *tissue, double at[2]) {
  const double *u = tissue->paddle;
  /* The table of the tests knows of 0.02. */
  at[0] = 0.30 * u[0] + 0.05 * u[1] + 0.025 * tissue->depth;
  at[1] = -0.04 * u[0] + 0.25 * u[1] - 0.1 * tissue->depth;
}

/* What the sensors have for this tick. */
static void sense(Tissue *tissue, uint32_t tick, StillpointInputs *inputs) {
  memset(inputs, 0, sizeof *inputs);
  inputs->tick = tick;
  inputs->time_ns = (uint64_t)tick * PERIOD_NS;

  /* From 3 s on the needle's sensor is silent for 0.4 s: the controller ends in SAFE. */
  if (tick < 3000 || tick >= 3400) {
    inputs->needle.sequence = tick;
    inputs->needle.time_ns = inputs->time_ns;
    inputs->needle.depth_lu = tissue->depth;
    inputs->needle.velocity_lu_per_s = tissue->speed;
    inputs->arrived |= STILLPOINT_NEEDLE_ARRIVED;
  }
  inputs->paddle.sequence = tick;
  inputs->paddle.time_ns = inputs->time_ns;
  inputs->paddle.paddle_index = tissue->paddle_index;
  inputs->paddle.displacement_lu[0] = tissue->paddle[0];
  inputs->paddle.displacement_lu[1] = tissue->paddle[1];
  inputs->arrived |= STILLPOINT_PADDLE_ARRIVED;

  if (tick % TARGET_TICKS == 0) {
    if (tissue->is_late) {
      inputs->target = tissue->late;
      inputs->arrived |= STILLPOINT_TARGET_ARRIVED;
    }
    tissue->late.sequence = tick / TARGET_TICKS;
    tissue->late.time_ns = inputs->time_ns;
    /* From 2 s on the target is out of sight for 0.1 s: the controller holds, and goes on by itself. */
    tissue->late.flags = tick < 2000 || tick >= 2100 ? STILLPOINT_TARGET_VISIBLE : 0;
    target_of(tissue, tissue->late.displacement_lu);
    tissue->is_late = 1;
  }
}

static void act(Tissue *tissue, const StillpointCommand *command) {
  if (command->flags & STILLPOINT_COMMAND_VALID) {
    tissue->paddle[0] = command->displacement_lu[0];
    tissue->paddle[1] = command->displacement_lu[1];
  }
  tissue->depth = tissue->depth + tissue->speed * 1e-3;
  if (tissue->depth >= tissue->end) {
    tissue->depth = tissue->end;
    tissue->speed = 0.0;
  }
}

static void print_bits(const StillpointCommand *command) {
  uint64_t x, y;
  memcpy(&x, &command->displacement_lu[0], sizeof x);
  memcpy(&y, &command->displacement_lu[1], sizeof y);
  printf("%" PRIu32 " %" PRIu32 " %" PRIu64 " %" PRIu64 " %" PRIx64 " %016" PRIx64 " %016" PRIx64, command->sequence,
         command->mode, command->tick, command->time_ns, command->faults, x, y);
  printf(" %" PRIu32 " %" PRIu32 " %" PRIu32 " %" PRIu32 "\n", command->needle_sequence, command->target_sequence,
         command->paddle_index, command->flags);
}

static void print_words(const StillpointCommand *command, const Tissue *tissue) {
  char faults[256];
  double target[2];
  (void)stillpoint_fault_names(command->faults, faults, sizeof faults);
  target_of(tissue, target);
  printf("%5.3f s  depth %.4f  %-4s  paddle %+.6f %+.6f  target aside %+.6f  %s\n", (double)command->time_ns * 1e-9,
         tissue->depth, stillpoint_mode_name(command->mode), command->displacement_lu[0], command->displacement_lu[1],
         target[0], faults);
}

/* Says what went wrong and what to do. */
static int fail(Stillpoint *controller, StillpointStatus status) {
  char text[256];
  if (stillpoint_last_error(controller, text, sizeof text) > 0 && controller) {
    fprintf(stderr, "loop: %s\n", text);
  } else {
    fprintf(stderr, "loop: %s\n", stillpoint_status_text(status));
  }
  return 1;
}

static size_t read_table(const char *path) {
  size_t bytes = 0;
  FILE *file = fopen(path, "rb");
  if (file) {
    bytes = fread(table_file, 1, sizeof table_file, file);
    fclose(file);
  }
  return bytes;
}

static int insert(Stillpoint *controller, int bits) {
  StillpointTable table;
  Tissue tissue;
  uint32_t tick, mode = 0;
  StillpointStatus status = stillpoint_table(controller, &table);
  if (status != STILLPOINT_STATUS_OK) {
    return fail(controller, status);
  }
  memset(&tissue, 0, sizeof tissue);
  tissue.end = table.depth_end_lu;
  tissue.speed = 0.2 * table.depth_end_lu; /* in 5 s */
  tissue.paddle_index = table.paddle_index;

  for (tick = 0; tick < TICKS; tick++) {
    StillpointInputs inputs;
    StillpointCommand command;
    sense(&tissue, tick, &inputs);
    status = stillpoint_step(controller, &inputs, &command);
    if (status != STILLPOINT_STATUS_OK) {
      return fail(controller, status);
    }
    if (bits) {
      print_bits(&command);
    } else if (command.mode != mode || tick % 500 == 0 || tick + 1 == TICKS) {
      print_words(&command, &tissue);
    }
    mode = command.mode;
    /* Somebody has looked after the needle's sensor. */
    if (tick == 3500) {
      status = stillpoint_rearm(controller);
      if (status != STILLPOINT_STATUS_OK) {
        return fail(controller, status);
      }
    }
    act(&tissue, &command);
  }
  return 0;
}

int main(int argc, char **argv) {
  Stillpoint *controller = NULL;
  StillpointSettings settings;
  StillpointStatus status;
  size_t bytes;
  int result;
  if (argc < 2 || argc > 3 || (argc == 3 && strcmp(argv[2], "--bits") != 0)) {
    fprintf(stderr, "usage: loop TABLE [--bits]\n");
    return 2;
  }
  bytes = read_table(argv[1]);
  if (bytes == 0) {
    fprintf(stderr, "loop: cannot read %s\n", argv[1]);
    return 2;
  }
  status = stillpoint_init(&memory, sizeof memory, STILLPOINT_API_VERSION, &controller);
  if (status == STILLPOINT_STATUS_OK) {
    status = stillpoint_load_table(controller, table_file, bytes);
  }
  if (status == STILLPOINT_STATUS_OK) {
    status = stillpoint_default_settings(PERIOD_NS, TARGET_TICKS * PERIOD_NS, TARGET_TICKS * PERIOD_NS, &settings);
  }
  if (status == STILLPOINT_STATUS_OK) {
    status = stillpoint_configure(controller, &settings);
  }
  if (status != STILLPOINT_STATUS_OK) {
    return fail(controller, status);
  }
  result = insert(controller, argc == 3);
  (void)stillpoint_release(controller);
  return result;
}
