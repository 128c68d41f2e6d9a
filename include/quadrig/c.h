/* quadrig from C and from languages that call C. Stands alone: C99 or C++, nothing but <stddef.h> and <stdint.h>.

   Everything made by a function that ends in _create, or handed out through a `**`, belongs to the caller and is given
   back with the _destroy of its type; a null pointer is then allowed. Nothing else is owned across the border: arrays
   that go in are copied before the call returns, arrays that come out are the caller's own.

   Functions return quadrig_ok (0) or the kind of failure; the message is in the job. No exception crosses, nothing is
   printed, there is no global state: any number of threads may work at once, each with a job of its own. One job is
   used by one thread at a time, but for quadrig_job_cancel, which any thread may call.

   Structs begin with `size`, the bytes that the caller knows: quadrig_options_init(&options, sizeof options) fills in
   `size` and the defaults. A library that knows more members takes their defaults; one that knows fewer refuses those
   that are not zero. */
#ifndef QUADRIG_C_H
#define QUADRIG_C_H

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32) && defined(QUADRIG_C_BUILDING)
#define QUADRIG_C_API __declspec(dllexport)
#elif defined(_WIN32)
#define QUADRIG_C_API __declspec(dllimport)
#elif defined(__GNUC__)
#define QUADRIG_C_API __attribute__((visibility("default")))
#else
#define QUADRIG_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* "0.1.0" */
QUADRIG_C_API const char* quadrig_version(void);

/* The numbers are the exit codes of the command. */
typedef enum quadrig_status {
  quadrig_ok = 0,
  quadrig_internal_error = 1,
  quadrig_bad_option = 2,
  quadrig_bad_file = 3,
  quadrig_bad_input = 4,
  quadrig_unsupported = 5,
  quadrig_numeric_failure = 6,
  quadrig_stage_failed = 7,
  quadrig_cancelled = 8,
  quadrig_done_in_part = 9, /* glTF: done, but parts stay as they were; the warnings tell which and why */
  quadrig_out_of_memory = 10,
  quadrig_too_small = 11 /* an array of the caller's holds less than is to be put in it */
} quadrig_status;

/* "bad_option" and so on; "unknown" for other numbers. */
QUADRIG_C_API const char* quadrig_status_name(quadrig_status status);

/* -- A job: threads, progress, cancel, and what was said ----------------------------------------------------------- */

typedef struct quadrig_job quadrig_job;

/* Null when there is no memory. */
QUADRIG_C_API quadrig_job* quadrig_job_create(void);
QUADRIG_C_API void quadrig_job_destroy(quadrig_job* job);
/* Most threads that a call uses; 0, the default: as many as the machine has. Results do not depend on it. */
QUADRIG_C_API void quadrig_job_set_threads(quadrig_job* job, uint32_t threads);
/* Calls that may need more bytes end with quadrig_out_of_memory before they take them; files larger than a fourth of it
   are refused as they are read. 0, the default: no limit. The need is estimated from above, from triangles, bones and
   quads. */
QUADRIG_C_API void quadrig_job_set_memory_limit(quadrig_job* job, uint64_t bytes);
/* `stage` names what goes on, `fraction` is the share of the whole that is done, from 0 to 1. Called from the thread
   that made the call, never from another. It may call quadrig_job_cancel, and must return. Null: none. */
typedef void (*quadrig_progress)(void* user, const char* stage, double fraction);
QUADRIG_C_API void quadrig_job_set_progress(quadrig_job* job, quadrig_progress progress, void* user);
/* Asks the running call to end soon with quadrig_cancelled; calls made later end at once, until _reset. */
QUADRIG_C_API void quadrig_job_cancel(quadrig_job* job);
/* Takes back a cancel, and forgets message and warnings. */
QUADRIG_C_API void quadrig_job_reset(quadrig_job* job);
/* Of the last call that failed: "where: what; remedy". Empty when none did. Stays until the next call with the job. */
QUADRIG_C_API const char* quadrig_job_message(const quadrig_job* job);
/* What the last call mended or could not honour. Null when `index` is too large. */
QUADRIG_C_API size_t quadrig_job_warning_count(const quadrig_job* job);
QUADRIG_C_API const char* quadrig_job_warning(const quadrig_job* job, size_t index);

/* -- Surfaces and rigs in ------------------------------------------------------------------------------------------ */

/* A triangle mesh, welded and mended as the command does it, with its rig where it has one. Never changes: may be used
   by several threads at once. */
typedef struct quadrig_asset quadrig_asset;

/* A bone from head to tail; one a column of the weights. Parents may stand in any order. */
typedef struct quadrig_bone {
  double head[3];
  double tail[3];
  int32_t parent; /* -1: none */
  uint32_t round; /* not 0: has no direction, pulls no edge */
} quadrig_bone;

typedef struct quadrig_mesh {
  size_t size;              /* bytes of this struct */
  const double* positions;  /* x y z a vertex; or null and the floats below */
  const float* positions_f; /* the same as floats */
  size_t vertex_count;
  const uint32_t* triangles; /* three vertices a triangle, counter-clockwise seen from outside */
  size_t triangle_count;
  /* The rig; all 0 or null where there is none. */
  const quadrig_bone* bones;
  size_t bone_count;
  size_t influences;      /* entries a vertex in the two arrays below */
  const uint32_t* joints; /* numbers of bones */
  const float* weights;   /* their shares, not negative; the sum of a vertex is rescaled to 1 */
  double weld_distance;   /* positions at most this far apart are one */
  uint32_t strict;        /* not 0: what would be mended is an error */
  uint32_t reserved;      /* 0 */
} quadrig_mesh;

QUADRIG_C_API void quadrig_mesh_init(quadrig_mesh* mesh, size_t size);
/* quadrig_bad_input: not a surface, or weights that do not fit; the message names the vertex or triangle. */
QUADRIG_C_API quadrig_status quadrig_asset_create(quadrig_job* job, const quadrig_mesh* mesh, quadrig_asset** asset);
/* From files: .obj, .off, .ply or .stl, with .tgf and .dmat or both null. */
QUADRIG_C_API quadrig_status quadrig_asset_load(quadrig_job* job, const char* mesh, const char* rig,
                                                const char* weights, quadrig_asset** asset);
QUADRIG_C_API void quadrig_asset_destroy(quadrig_asset* asset);
QUADRIG_C_API size_t quadrig_asset_vertex_count(const quadrig_asset* asset);
QUADRIG_C_API size_t quadrig_asset_triangle_count(const quadrig_asset* asset);
QUADRIG_C_API size_t quadrig_asset_bone_count(const quadrig_asset* asset);

/* -- Quads out ----------------------------------------------------------------------------------------------------- */

typedef enum quadrig_preset {
  quadrig_preset_default = 0,
  quadrig_preset_thesis = 1,
  quadrig_preset_static = 2
} quadrig_preset;

/* Borders that become edges of quads, to be added up. */
typedef enum quadrig_keep {
  quadrig_keep_materials = 1, /* glTF: between materials */
  quadrig_keep_textures = 2,  /* glTF: where texture coordinates or colours part */
  quadrig_keep_groups = 4     /* where another bone's weight becomes the largest */
} quadrig_keep;

/* The same quads on both sides of a mirror plane. */
typedef enum quadrig_symmetry {
  quadrig_symmetry_default = 0, /* automatic with a rig, else none */
  quadrig_symmetry_none = 1,
  quadrig_symmetry_automatic = 2, /* whichever plane takes the surface to itself, if one does */
  quadrig_symmetry_x = 3,         /* across this axis, or nearly */
  quadrig_symmetry_y = 4,
  quadrig_symmetry_z = 5
} quadrig_symmetry;

/* Where vertices go once the quads are made. */
typedef enum quadrig_fit {
  quadrig_fit_default = 0,    /* surface */
  quadrig_fit_none = 1,       /* where quads are most even */
  quadrig_fit_slide = 2,      /* along the surface to where the quads are nearest to it, at rest and bent */
  quadrig_fit_surface = 3,    /* likewise off the surface */
  quadrig_fit_subdivision = 4 /* to where the surface is nearest that subdividing the quads makes */
} quadrig_fit;

typedef struct quadrig_options {
  size_t size;            /* bytes of this struct */
  uint32_t quads;         /* wanted: 2000 */
  uint32_t preset;        /* quadrig_preset_default */
  uint32_t influences;    /* most weights that a vertex keeps: 4 */
  uint32_t strict;        /* glTF: not 0: what would be mended, or a part that fails, is an error */
  double crease_degrees;  /* edges that bend more stay edges; 180: none; 0, the default: where all is flat sides */
  double bend_degrees;    /* how far the poses bend each bone: 60 */
  double count_tolerance; /* how far off the count may be: 0.05 */
  double bones;           /* pull of the bones on the directions; negative, the default: the preset's */
  double curvature;       /* pull of the curvature at rest; likewise */
  double posed;           /* pull of the curvature over the poses: 0 */
  /* Of glTF files. */
  uint32_t clips;            /* not 0: sizes for the poses of the file's clips */
  uint32_t unskinned;        /* not 0: meshes that no skin moves too */
  uint32_t source_map;       /* not 0: _SOURCE, see docs/gltf.md */
  uint32_t select_count;     /* entries of `select` */
  const char* const* select; /* names or regular expressions; see docs/gltf.md */
  /* What quads keep beside creases. */
  uint32_t keep;         /* of quadrig_keep: 0 */
  uint32_t edge_count;   /* of an asset that was made from arrays: entries of `edges`, two vertices each */
  const uint32_t* edges; /* edges of its triangles that become edges of quads */
  /* Of the caller's own, of an asset that was made from arrays; null or 0, the default: none. */
  size_t density_count;                /* one a triangle */
  const double* density;               /* quads a unit area, relative to each other, > 0 */
  size_t direction_count;              /* entries of the next three */
  const uint32_t* direction_triangles; /* triangles whose quads run along or across a direction */
  const double* directions;            /* three numbers each */
  const double* direction_weights;     /* that of a bone is 1; infinity, or null: exactly so */
  size_t symmetry;                     /* quadrig_symmetry_default */
  /* What the density is multiplied by, from 1/64 to 64, on top of what the error asks for. The count stays. */
  size_t density_factor_count; /* of an asset that was made from arrays: one a triangle; 0: none */
  const double* density_factors;
  size_t bone_density_count; /* one a bone; 0: none */
  const double* bone_density;
  /* Closed rings of quads round the joints that bend a limb. */
  uint32_t loops;                 /* at each, where the count allows: 3 */
  uint32_t joint_loop_count;      /* entries of the next two */
  const char* const* loop_joints; /* names of joints, in which * stands for anything */
  const uint32_t* joint_loops;    /* rings round these; the last name that fits counts */
  size_t fit;                     /* quadrig_fit_default; quadrig_unsupported: subdivision where it was left out */
  size_t rings;                   /* round eyes and mouth, of what has a rig, where the count allows: 3 */
  size_t clip_directions;         /* glTF; not 0: bones give directions in the poses of the clips, averaged */
  size_t curl_rounds;             /* of moving directions and sizes towards those of a map: 0; docs/curl.md */
} quadrig_options;

QUADRIG_C_API void quadrig_options_init(quadrig_options* options, size_t size);

typedef struct quadrig_quads quadrig_quads;

/* \pre the asset is not destroyed while the call runs. `options` null: the defaults. */
QUADRIG_C_API quadrig_status quadrig_remesh(quadrig_job* job, const quadrig_asset* asset,
                                            const quadrig_options* options, quadrig_quads** quads);
QUADRIG_C_API void quadrig_quads_destroy(quadrig_quads* quads);

typedef struct quadrig_figures {
  size_t size; /* bytes of this struct, set by the caller */
  size_t quads, vertices, irregular;
  size_t minimum_count; /* the count where it is more than the tolerance above what was asked; else 0 */
  double scaled_jacobian_average, scaled_jacobian_minimum;
  double seconds;
} quadrig_figures;

QUADRIG_C_API quadrig_status quadrig_quads_figures(const quadrig_quads* quads, quadrig_figures* figures);
QUADRIG_C_API size_t quadrig_quads_count(const quadrig_quads* quads);
QUADRIG_C_API size_t quadrig_quads_vertex_count(const quadrig_quads* quads);

/* Each puts an array into the caller's; `capacity` counts numbers, not bytes. quadrig_too_small: nothing was put. */
/* Three a vertex. */
QUADRIG_C_API quadrig_status quadrig_quads_positions(const quadrig_quads* quads, double* out, size_t capacity);
QUADRIG_C_API quadrig_status quadrig_quads_positions_f(const quadrig_quads* quads, float* out, size_t capacity);
/* Four vertices a quad, counter-clockwise. */
QUADRIG_C_API quadrig_status quadrig_quads_indices(const quadrig_quads* quads, uint32_t* out, size_t capacity);
/* `influences` a vertex, strongest first, rescaled to sum 1; places left over are bone 0 with weight 0.
   quadrig_bad_option where the asset has no rig or `influences` is 0. */
QUADRIG_C_API quadrig_status quadrig_quads_weights(const quadrig_quads* quads, size_t influences, uint32_t* joints,
                                                   float* weights, size_t capacity);
/* Where each vertex lies on what was given to quadrig_asset_create: a triangle, and three barycentric coordinates in
   it. Of an asset from files: a polygon of the mesh file, from 0, and `barycentric` must be null. Either array may be
   null. */
QUADRIG_C_API quadrig_status quadrig_quads_source(const quadrig_quads* quads, uint32_t* triangles, size_t capacity,
                                                  double* barycentric, size_t barycentric_capacity);

/* The vertex across the mirror plane, itself on it; UINT32_MAX: none. One a vertex. */
QUADRIG_C_API quadrig_status quadrig_quads_twins(const quadrig_quads* quads, uint32_t* out, size_t capacity);

/* -- glTF ---------------------------------------------------------------------------------------------------------- */

/* Bytes that the library made. */
typedef struct quadrig_bytes quadrig_bytes;
QUADRIG_C_API const void* quadrig_bytes_data(const quadrig_bytes* bytes);
QUADRIG_C_API size_t quadrig_bytes_size(const quadrig_bytes* bytes);
QUADRIG_C_API void quadrig_bytes_destroy(quadrig_bytes* bytes);

/* .glb or .gltf in memory, remeshed, as a .glb. `name` stands for the file in messages; its folder is where buffers
   that the file names are looked for. Null, or without a folder: such buffers are refused. Images, and buffers beyond
   the first, stay the names that they are. quadrig_done_in_part also gives bytes. */
QUADRIG_C_API quadrig_status quadrig_remesh_gltf(quadrig_job* job, const void* data, size_t size, const char* name,
                                                 const quadrig_options* options, quadrig_bytes** glb);
/* From file to file, .glb or .gltf by their extensions. Nothing is written unless everything is; at
   quadrig_done_in_part it is. quadrig_bad_option, before any work, where the output is a file that is read, or a file
   beside it that only the document names would be replaced. */
QUADRIG_C_API quadrig_status quadrig_remesh_gltf_file(quadrig_job* job, const char* input, const char* output,
                                                      const quadrig_options* options);

#ifdef __cplusplus
}
#endif

#endif
