/* A tube along y with two bones, in plain arrays. */
#ifndef SHAPE_H
#define SHAPE_H

#include <math.h>
#include <string.h>

#include <quadrig/c.h>

enum {
  sides = 16,
  rings = 24,
  shape_vertices = sides * (rings + 1) + 2,
  shape_triangles = 2 * sides * rings + 2 * sides
};

typedef struct shape {
  float positions[3 * shape_vertices];
  uint32_t triangles[3 * shape_triangles];
  uint32_t joints[2 * shape_vertices];
  float weights[2 * shape_vertices];
  quadrig_bone bones[2];
} shape;

static void put_triangle(shape* s, size_t* t, int a, int b, int c) {
  s->triangles[3 * *t] = (uint32_t)a;
  s->triangles[3 * *t + 1] = (uint32_t)b;
  s->triangles[3 * *t + 2] = (uint32_t)c;
  ++*t;
}

static void make_shape(shape* s, quadrig_mesh* mesh) {
  const int bottom = sides * (rings + 1), top = bottom + 1;
  size_t t = 0;
  memset(s, 0, sizeof *s);
  for (int v = 0; v < shape_vertices; ++v) {
    const int ring = v / sides, side = v % sides;
    const double angle = 6.283185307179586 * side / sides, radius = v < bottom ? 0.3 : 0.0;
    const double y = v == bottom ? 0.0 : v == top ? 2.0 : 2.0 * ring / rings;
    double upper = 2.0 * (y - 0.75);
    upper = upper < 0 ? 0 : upper > 1 ? 1 : upper;
    s->positions[3 * v] = (float)(radius * cos(angle));
    s->positions[3 * v + 1] = (float)y;
    s->positions[3 * v + 2] = (float)(radius * sin(angle));
    s->joints[2 * v + 1] = 1;
    s->weights[2 * v] = (float)(1 - upper);
    s->weights[2 * v + 1] = (float)upper;
  }
  for (int r = 0; r < rings; ++r)
    for (int i = 0; i < sides; ++i) {
      const int a = r * sides + i, b = r * sides + (i + 1) % sides;
      put_triangle(s, &t, a, b + sides, b);
      put_triangle(s, &t, a, a + sides, b + sides);
    }
  for (int i = 0; i < sides; ++i) {
    const int next = (i + 1) % sides;
    put_triangle(s, &t, bottom, i, next);
    put_triangle(s, &t, top, rings * sides + next, rings * sides + i);
  }
  s->bones[0].tail[1] = 1;
  s->bones[0].parent = -1;
  s->bones[1].head[1] = 1;
  s->bones[1].tail[1] = 2;
  quadrig_mesh_init(mesh, sizeof *mesh);
  mesh->positions_f = s->positions;
  mesh->vertex_count = shape_vertices;
  mesh->triangles = s->triangles;
  mesh->triangle_count = shape_triangles;
  mesh->bones = s->bones;
  mesh->bone_count = 2;
  mesh->influences = 2;
  mesh->joints = s->joints;
  mesh->weights = s->weights;
}

#endif
