/* A program that calls the C interface: HOST IN.glb OUT.glb [THREADS]. Ends with the status, and tells its message as
   the command does. */
#include <stdio.h>
#include <stdlib.h>

#include "quadrig/c.h"

int main(int argc, char** argv) {
  if (argc < 3) return quadrig_bad_option;
  quadrig_job* job = quadrig_job_create();
  if (!job) {
    fputs("quadrig: no job\n", stderr);
    return quadrig_out_of_memory;
  }
  quadrig_job_set_threads(job, argc > 3 ? (uint32_t)atoi(argv[3]) : 1);
  quadrig_options options;
  quadrig_options_init(&options, sizeof options);
  options.quads = 100;

  const double positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const uint32_t triangles[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
  const quadrig_bone bones[] = {{{0, 0, 0}, {1, 0, 0}, -1, 0}, {{1, 0, 0}, {1, 1, 0}, 0, 0}};
  const uint32_t joints[] = {0, 1, 0, 1};
  const float weights[] = {1, 1, 1, 1};
  quadrig_mesh mesh;
  quadrig_mesh_init(&mesh, sizeof mesh);
  mesh.positions = positions;
  mesh.vertex_count = 4;
  mesh.triangles = triangles;
  mesh.triangle_count = 4;
  mesh.bones = bones;
  mesh.bone_count = 2;
  mesh.joints = joints;
  mesh.weights = weights;
  mesh.influences = 1;
  quadrig_asset* asset = NULL;
  quadrig_quads* quads = NULL;
  quadrig_status status = quadrig_asset_create(job, &mesh, &asset);
  if (status == quadrig_ok) status = quadrig_remesh(job, asset, &options, &quads);
  if (status == quadrig_ok) status = quadrig_remesh_gltf_file(job, argv[1], argv[2], &options);
  if (status != quadrig_ok) fprintf(stderr, "quadrig: %s\n", quadrig_job_message(job));
  quadrig_quads_destroy(quads);
  quadrig_asset_destroy(asset);
  quadrig_job_destroy(job);
  return (int)status;
}
