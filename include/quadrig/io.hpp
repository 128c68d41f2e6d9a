// Mesh, rig and weight files: the door of the compiled target quadrig::io.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "quadrig/asset.hpp"
#include "quadrig/density.hpp"
#include "quadrig/prepare.hpp"
#include "quadrig/quads.hpp"
#include "quadrig/weights.hpp"

namespace quadrig {

/// What a file may ask for at most; every count and size is held against these, and against the bytes that the file
/// really has, before memory is taken.
struct FileLimits {
  std::size_t bytes = std::size_t{4} << 30;
  Index vertices = 200'000'000;
  Index polygons = 400'000'000;
  Index bones = 100'000;
};

// Readers. All fail with bad_file where the file cannot be read, and with bad_input naming the file and its line (or
// byte, in binary files) where it is not what its format allows: bad numbers, indices out of range, values that are
// not finite, fewer entries than announced, more than the limits (bad_file where it is of more bytes than they allow).
// Lines may end with any of LF, CR and CRLF; texts may be UTF-8, or UTF-16 with its mark.

/// Wavefront OBJ: v and f in all index forms, relative ones too, with what vt, usemtl and l tell of them; what is no
/// surface (normals, groups, points) is passed over; curves and free-form surfaces are counted and told as a warning.
[[nodiscard]] Expected<PolygonMesh> read_obj(const std::filesystem::path& path, const FileLimits& limits,
                                             Context& context);
/// Object File Format, as text or big-endian bytes: OFF, COFF, NOFF and so on, in any case; colours and normals are
/// passed over.
[[nodiscard]] Expected<PolygonMesh> read_off(const std::filesystem::path& path, const FileLimits& limits,
                                             Context& context);
/// Stanford PLY, ascii and binary of both byte orders; any scalar types, elements and properties in any order; uses
/// vertex x y z and the list vertex_indices or vertex_index of face, or of tristrips.
[[nodiscard]] Expected<PolygonMesh> read_ply(const std::filesystem::path& path, const FileLimits& limits,
                                             Context& context);
/// Stereolithography, as text or little-endian bytes; corners at one position are one vertex, normals are passed over.
[[nodiscard]] Expected<PolygonMesh> read_stl(const std::filesystem::path& path, const FileLimits& limits,
                                             Context& context);
/// By the file's extension, .obj, .off, .ply or .stl, in any case, and by how it begins where it has none.
/// \fails unsupported on another
[[nodiscard]] Expected<PolygonMesh> read_surface(const std::filesystem::path& path, const FileLimits& limits,
                                                 Context& context);

/// A curve of straight pieces.
struct Polyline {
  std::vector<Vector3> points;  ///< two or more; of a closed one the first is not repeated
  bool closed = false;
};
/// The lines (l) of an OBJ, which needs no faces: those that share an end with one other alone are one curve.
/// \fails as read_obj; bad_input where there are none
[[nodiscard]] Expected<std::vector<Polyline>> read_lines(const std::filesystem::path& path, const FileLimits& limits,
                                                         Context& context);

/// libigl's TGF: one joint a line (number, x, y, z; further columns are ignored), a line `#`, then one bone a line
/// (numbers of its two joints; further columns are ignored), and whatever follows a second `#` is ignored. A bone's
/// parent is the first bone that ends at the joint where it starts. Bones of zero length lose their direction and are
/// told as a warning.
[[nodiscard]] Expected<Skeleton> read_tgf(const std::filesystem::path& path, const FileLimits& limits,
                                          Context& context);

/// libigl's DMAT, columns × rows then the values by column; ascii, or binary after a line `0 0` and a second line with
/// the counts. \return rows × columns, all finite.
[[nodiscard]] Expected<Eigen::MatrixXd> read_dmat(const std::filesystem::path& path, const FileLimits& limits,
                                                  const Context* context = nullptr);

// Writers. The file is written beside its place under a temporary name and renamed, so a failure leaves an older file
// as it was and nothing half-written. Numbers have 17 significant digits: reading them back gives the same bits.
// All fail with bad_file.

[[nodiscard]] Status write_obj(const std::filesystem::path& path, const QuadMesh& mesh);
[[nodiscard]] Status write_obj(const std::filesystem::path& path, const Points<double>& positions,
                               const Triangles& faces);
[[nodiscard]] Status write_tgf(const std::filesystem::path& path, const Skeleton& skeleton);
enum class DmatFormat : std::uint8_t { ascii, binary };
[[nodiscard]] Status write_dmat(const std::filesystem::path& path, const Eigen::MatrixXd& matrix,
                                DmatFormat format = DmatFormat::ascii);
[[nodiscard]] Status write_dmat(const std::filesystem::path& path, const SkinWeights& weights,
                                DmatFormat format = DmatFormat::ascii);
/// Any text or bytes, with the same promise.
[[nodiscard]] Status write_file(const std::filesystem::path& path, std::string_view contents);

/// Whether two names are of one file, be it there or not yet. Links are followed.
[[nodiscard]] bool same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Every file that one job reads and writes. Inputs and outputs are declared before the work and held against one
/// another by what they are: other spellings, links and hard links of a file are that file. Contents are kept in memory
/// and appear together: `commit` writes pipes and devices first, then temporary files, which it renames; where one
/// fails the older files are as they were. Nothing is on the disk before `commit`.
class FileSet {
 public:
  /// Files that a document names beside an output may replace others with other bytes.
  bool replaces_beside = false;
  /// The name `-` stands for standard output, which `commit` writes in one go, before all files.
  bool standard_output = false;

  FileSet() = default;
  ~FileSet() = default;
  FileSet(FileSet&&) = default;
  FileSet(const FileSet&) = delete;
  FileSet& operator=(const FileSet&) = delete;
  FileSet& operator=(FileSet&&) = default;
  /// Lets `commit` make a folder and those above it, and remove them again where it fails.
  void make_folder(const std::filesystem::path& folder);
  /// Declares an input, be it there or not. \fails bad_option where it is an output
  [[nodiscard]] Status reads(const std::filesystem::path& path);
  /// Declares an output that the caller names. Links are followed.
  /// \fails bad_option where it is an input or another output; bad_file where it is a folder, or its own folder is
  ///   absent or may not be written
  [[nodiscard]] Status writes(const std::filesystem::path& path);
  /// The contents of an output, declared or not. The same contents once more change nothing.
  /// \fails as `writes`; bad_option where it has other contents
  [[nodiscard]] Status add(const std::filesystem::path& path, std::string contents);
  /// A file that only the document at `place` names, `name` being relative to its folder. One that is there with the
  /// same bytes is left.
  /// \fails as `add`; bad_option where one is there with other bytes and `replaces_beside` is not set; bad_file where a
  ///   link leads out of the folder, or what is there is no regular file
  [[nodiscard]] Status add_beside(const std::filesystem::path& place, const std::filesystem::path& name,
                                  std::string contents);
  /// One with the same declarations, to find out what would be refused; it is not to be committed.
  [[nodiscard]] FileSet trial() const;
  /// Whether an output is standard output.
  [[nodiscard]] bool uses_standard_output() const;
  /// \fails bad_file; then every file is as it was
  [[nodiscard]] Status commit();

 private:
  struct Entry {
    std::filesystem::path named, place;
    std::optional<std::string> contents;
    bool device = false;
  };
  [[nodiscard]] std::vector<std::string> keys_of(const std::filesystem::path& path) const;
  [[nodiscard]] bool is_stream(const std::filesystem::path& path) const { return standard_output && path == "-"; }
  [[nodiscard]] const Entry* entry_at(const std::vector<std::string>& keys) const;

  std::vector<Entry> entries_;
  std::map<std::string, std::size_t> outputs_;           // by what a file is known by
  std::map<std::string, std::filesystem::path> inputs_;  // likewise
  std::set<std::filesystem::path> folders_;              // that are to be made
};

/// The text of each writer, for a FileSet.
[[nodiscard]] std::string obj_text(const QuadMesh& mesh);
[[nodiscard]] std::string obj_text(const Points<double>& positions, const Triangles& faces);
[[nodiscard]] std::string tgf_text(const Skeleton& skeleton);
[[nodiscard]] std::string dmat_text(const Eigen::MatrixXd& matrix, DmatFormat format = DmatFormat::ascii);
[[nodiscard]] std::string dmat_text(const SkinWeights& weights, DmatFormat format = DmatFormat::ascii);

/// The files of one asset. `rig` and `weights` are both empty or both given, or `weights` are to be made.
struct AssetFiles {
  std::filesystem::path mesh, rig, weights;
};

/// Edges of the surface file that quads must keep.
struct KeepOptions {
  bool materials = false;  ///< between faces of different materials
  bool textures = false;   ///< where the texture coordinates part: the borders of texture islands
  bool lines = false;      ///< drawn as lines
  [[nodiscard]] bool any() const { return materials || textures || lines; }
};

/// Density by hand that a surface file tells.
struct DensityOptions {
  std::vector<NamedFactor> materials;  ///< by the names of its materials
  bool colors = false;                 ///< by the colours of its vertices (density_of_color)
  [[nodiscard]] bool any() const { return colors || !materials.empty(); }
};

struct LoadOptions {
  PrepareOptions prepare;
  std::optional<BindOptions> bind = std::nullopt;  ///< how to make the weights of a rig that comes without
  KeepOptions keep;
  DensityOptions density;
  FileLimits limits;
};

struct LoadedAsset {
  Asset asset;
  std::vector<Index> source_vertex;     ///< vertex of the mesh file, from 0, that each vertex stands for
  std::vector<Index> source_polygon;    ///< polygon of the mesh file, from 0, that each face is part of
  std::vector<double> density_factors;  ///< one a face, where LoadOptions::density asks for them
  std::vector<Index> features;          ///< half-edges that LoadOptions::keep asked for, both of a pair, ascending
  PrepareReport report;
};

/// Reads, checks and mends an asset; what was mended, and what was to be kept and is not there, is told to `context` as
/// warnings.
/// \fails as the readers and `prepare` do; bad_input where the counts of two files differ: names both files.
[[nodiscard]] Expected<LoadedAsset> load_asset(const AssetFiles& files, const LoadOptions& options, Context& context);

}  // namespace quadrig
