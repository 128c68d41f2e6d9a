/* A C99 program: a rigged mesh from its own arrays, quads back into them, from two threads at once. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>

#include "shape.h"

#define CHECK(condition)                                              \
  do {                                                                \
    if (!(condition)) {                                               \
      fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      exit(1);                                                        \
    }                                                                 \
  } while (0)

typedef struct work {
  const quadrig_asset* asset;
  uint32_t threads;
  size_t quad_count, vertex_count;
  double* positions;
  uint32_t* indices;
  int calls;
} work;

static void on_progress(void* user, const char* stage, double fraction) {
  CHECK(stage[0] != '\0' && fraction >= 0 && fraction <= 1);
  ++((work*)user)->calls;
}

static void* run(void* argument) {
  work* w = (work*)argument;
  quadrig_quads* quads = NULL;
  quadrig_options options;
  quadrig_figures figures;
  quadrig_job* job = quadrig_job_create();
  uint32_t* joints;
  float* weights;
  CHECK(job);
  quadrig_job_set_threads(job, w->threads);
  quadrig_job_set_progress(job, on_progress, w);
  quadrig_options_init(&options, sizeof options);
  options.quads = 400;
  if (quadrig_remesh(job, w->asset, &options, &quads) != quadrig_ok) {
    fprintf(stderr, "%s\n", quadrig_job_message(job));
    exit(1);
  }
  CHECK(quadrig_job_message(job)[0] == '\0');
  memset(&figures, 0, sizeof figures);
  figures.size = sizeof figures;
  CHECK(quadrig_quads_figures(quads, &figures) == quadrig_ok);
  CHECK(figures.scaled_jacobian_minimum > 0);
  w->quad_count = quadrig_quads_count(quads);
  w->vertex_count = quadrig_quads_vertex_count(quads);
  CHECK(figures.quads == w->quad_count && w->quad_count >= 380 && w->quad_count <= 420);
  w->positions = malloc(3 * w->vertex_count * sizeof *w->positions);
  w->indices = malloc(4 * w->quad_count * sizeof *w->indices);
  joints = malloc(4 * w->vertex_count * sizeof *joints);
  weights = malloc(4 * w->vertex_count * sizeof *weights);
  CHECK(w->positions && w->indices && joints && weights);
  CHECK(quadrig_quads_positions(quads, w->positions, 3 * w->vertex_count - 1) == quadrig_too_small);
  CHECK(quadrig_quads_positions(quads, w->positions, 3 * w->vertex_count) == quadrig_ok);
  CHECK(quadrig_quads_indices(quads, w->indices, 4 * w->quad_count) == quadrig_ok);
  CHECK(quadrig_quads_weights(quads, 4, joints, weights, 4 * w->vertex_count) == quadrig_ok);
  for (size_t i = 0; i < 4 * w->quad_count; ++i) CHECK(w->indices[i] < w->vertex_count);
  for (size_t v = 0; v < w->vertex_count; ++v) {
    float sum = 0;
    for (size_t k = 4 * v; k < 4 * v + 4; ++k) {
      CHECK(joints[k] < 2 && weights[k] >= 0);
      sum += weights[k];
    }
    CHECK(sum > 0.99999F && sum < 1.00001F);
  }
  free(joints);
  free(weights);
  quadrig_quads_destroy(quads);
  quadrig_job_destroy(job);
  return NULL;
}

int main(void) {
  static shape s;
  quadrig_mesh mesh;
  quadrig_asset* asset = NULL;
  quadrig_job* job = quadrig_job_create();
  work one = {0}, two = {0};
  pthread_t first, second;
  CHECK(job);
  CHECK(strcmp(quadrig_version(), "0.1.0") == 0);
  make_shape(&s, &mesh);
  s.triangles[5] = shape_vertices;
  CHECK(quadrig_asset_create(job, &mesh, &asset) == quadrig_bad_input);
  CHECK(!asset && strstr(quadrig_job_message(job), "triangle 1"));
  make_shape(&s, &mesh);
  if (quadrig_asset_create(job, &mesh, &asset) != quadrig_ok) {
    fprintf(stderr, "%s\n", quadrig_job_message(job));
    return 1;
  }
  CHECK(quadrig_asset_triangle_count(asset) == shape_triangles);
  CHECK(quadrig_asset_bone_count(asset) == 2);

  /* Two threads on one asset: the same bytes. */
  one.asset = two.asset = asset;
  one.threads = 1;
  two.threads = 3;
  CHECK(pthread_create(&first, NULL, run, &one) == 0);
  CHECK(pthread_create(&second, NULL, run, &two) == 0);
  CHECK(pthread_join(first, NULL) == 0);
  CHECK(pthread_join(second, NULL) == 0);
  CHECK(one.calls > 0 && two.calls > 0);
  CHECK(one.quad_count == two.quad_count && one.vertex_count == two.vertex_count);
  CHECK(memcmp(one.positions, two.positions, 3 * one.vertex_count * sizeof *one.positions) == 0);
  CHECK(memcmp(one.indices, two.indices, 4 * one.quad_count * sizeof *one.indices) == 0);
  free(one.positions);
  free(one.indices);
  free(two.positions);
  free(two.indices);
  quadrig_asset_destroy(asset);
  quadrig_job_destroy(job);
  puts("C99: ok");
  return 0;
}
