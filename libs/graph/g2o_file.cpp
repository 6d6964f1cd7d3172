#include "graph/g2o_file.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <sstream>
#include <vector>

#include "core/errors.h"
#include "core/output_file.h"

namespace raceloc {

namespace {

/** Numbers of one line, and where that line is. */
class Line {
 public:
  Line(const std::string& path, std::size_t number, const std::string& text)
      : x_path(path), x_number(number), x_text(text) {
    x_text >> x_tag;
  }

  [[nodiscard]] const std::string& tag() const { return x_tag; }
  [[nodiscard]] InputError error(const std::string& what) const {
    return InputError("g2o " + x_path + ":" + std::to_string(x_number) + ": " + what);
  }

  long key() {
    long value = 0;
    if (!(x_text >> value)) throw error(x_tag + " without the number of a pose where one must be");
    return value;
  }
  std::vector<double> numbers(std::size_t count) {
    std::vector<double> values(count);
    for (std::size_t k = 0; k < count; ++k)
      if (!(x_text >> values[k]))
        throw error(x_tag + " has " + std::to_string(k) + " readable numbers where " + std::to_string(count) +
                    " must be");
    return values;
  }
  bool ended() { return (x_text >> std::ws).eof(); }
  void end() {
    std::string rest;
    if (x_text >> rest) throw error(x_tag + " goes on with '" + rest + "' where it must end");
  }

 private:
  const std::string& x_path;
  std::size_t x_number;
  std::istringstream x_text;
  std::string x_tag;
};

/** How a tag writes a pose and an information matrix. */
enum class Form { quaternion, roll_pitch_yaw, planar };

Pose readPose(Line& line, Form form) {
  const auto v = line.numbers(form == Form::quaternion ? 7 : form == Form::planar ? 3 : 6);
  if (form == Form::planar) return poseFromRpy({v[0], v[1], 0}, 0, 0, v[2]);
  if (form == Form::roll_pitch_yaw) return poseFromRpy({v[0], v[1], v[2]}, v[3], v[4], v[5]);
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  if (!(std::abs(q.norm() - 1) < 1e-2)) throw line.error("the quaternion's norm is not 1");
  Pose T = Pose::Identity();
  T.linear() = q.normalized().toRotationMatrix();
  T.translation() << v[0], v[1], v[2];
  return T;
}

/** d (roll, pitch, yaw) / d q, for a rotation R exp(2 q): the angular rate of the body by those of the angles,
 * inverted. */
Eigen::Matrix3d anglesByQuaternion(Line& line, const Eigen::Matrix3d& R) {
  const double roll_rad = std::atan2(R(2, 1), R(2, 2)), sine = -R(2, 0),
               cosine = std::hypot(R(2, 1), R(2, 2));
  if (cosine < 1e-6) throw line.error("the pitch is a right angle, where roll and yaw have no information");
  Eigen::Matrix3d rate;
  rate << 1, 0, -sine, 0, std::cos(roll_rad), std::sin(roll_rad) * cosine, 0, -std::sin(roll_rad),
      std::cos(roll_rad) * cosine;
  return 2 * rate.inverse();
}

/** Upper triangle row by row, (translation, rotation) in the file, (rotation, translation) here; edges of TORO
 * may do without. \return W with W' W the information */
Matrix6d readWhitening(Line& line, Form form, const Eigen::Matrix3d& R) {
  Matrix6d information = Matrix6d::Identity();
  if (form != Form::roll_pitch_yaw || !line.ended()) {
    const std::vector<int> places =
        form == Form::planar ? std::vector{3, 4, 2} : std::vector{3, 4, 5, 0, 1, 2};
    const auto v = line.numbers(places.size() * (places.size() + 1) / 2);
    auto value = v.begin();
    for (std::size_t r = 0; r < places.size(); ++r)
      for (std::size_t c = r; c < places.size(); ++c)
        information(places[r], places[c]) = information(places[c], places[r]) = *value++;
  }
  if (form == Form::roll_pitch_yaw) {
    Matrix6d J = Matrix6d::Identity();
    J.topLeftCorner<3, 3>() = anglesByQuaternion(line, R);
    information = J.transpose() * information * J;
  }
  const Eigen::LLT<Matrix6d> factor(information);
  if (factor.info() != Eigen::Success) throw line.error("the information matrix is not positive definite");
  return factor.matrixU();
}

class Reader {
 public:
  explicit Reader(const std::string& path) : x_path(path) {}

  PoseGraph read() {
    std::ifstream file(x_path);
    if (!file) throw InputError("g2o " + x_path + ": cannot be read; check the path");
    std::string text;
    for (std::size_t number = 1; std::getline(file, text); ++number) {
      Line line(x_path, number, text);
      if (!line.tag().empty() && line.tag()[0] != '#') take(line);
    }
    if (file.bad()) throw InputError("g2o " + x_path + ": reading failed");
    if (x_graph.T_map_body.empty()) throw InputError("g2o " + x_path + ": no vertex and no edge in it");
    if (!x_graph.held) x_graph.held = 0;
    return std::move(x_graph);
  }

 private:
  void take(Line& line) {
    static const std::map<std::string, Form> vertices{{"VERTEX_SE3:QUAT", Form::quaternion},
                                                      {"VERTEX3", Form::roll_pitch_yaw},
                                                      {"VERTEX_SE2", Form::planar},
                                                      {"VERTEX2", Form::planar}};
    static const std::map<std::string, Form> edges{{"EDGE_SE3:QUAT", Form::quaternion},
                                                   {"EDGE3", Form::roll_pitch_yaw},
                                                   {"EDGE_SE2", Form::planar},
                                                   {"EDGE2", Form::planar}};
    if (const auto vertex = vertices.find(line.tag()); vertex != vertices.end())
      takeVertex(line, vertex->second);
    else if (const auto edge = edges.find(line.tag()); edge != edges.end())
      takeEdge(line, edge->second);
    else if (line.tag() == "FIX")
      takeFix(line);
    else
      throw line.error("'" + line.tag() + "' is no tag of a pose graph that is read here");
    line.end();
  }

  void takeVertex(Line& line, Form form) {
    const long number = line.key();
    if (x_keys.count(number) > 0)
      throw line.error("pose " + std::to_string(number) +
                       " is there already, by its vertex or an edge before");
    addPose(number, readPose(line, form));
  }

  void takeEdge(Line& line, Form form) {
    const long from = line.key(), to = line.key();
    if (from == to) throw line.error("an edge from pose " + std::to_string(from) + " to itself");
    const Pose T_from_to = readPose(line, form);
    const Matrix6d whitening = readWhitening(line, form, T_from_to.linear());
    if (x_keys.empty()) addPose(from, Pose::Identity());
    const auto i = x_keys.find(from), j = x_keys.find(to);
    if (i == x_keys.end() && j == x_keys.end())
      throw line.error("neither pose " + std::to_string(from) + " nor pose " + std::to_string(to) +
                       " has a vertex line or an edge before this one");
    if (i == x_keys.end()) addPose(from, x_graph.T_map_body[j->second] * T_from_to.inverse());
    if (j == x_keys.end()) addPose(to, x_graph.T_map_body[x_keys.at(from)] * T_from_to);
    x_graph.factors.emplace_back(BetweenFactor{x_keys.at(from), x_keys.at(to), T_from_to, whitening, {}});
  }

  void takeFix(Line& line) {
    const auto key = x_keys.find(line.key());
    if (key == x_keys.end()) throw line.error("FIX of a pose that is not there yet");
    if (x_graph.held && *x_graph.held != key->second) throw line.error("a second FIX: one pose can be held");
    x_graph.held = key->second;
  }

  void addPose(long number, const Pose& T) {
    x_keys.emplace(number, x_graph.T_map_body.size());
    x_graph.T_map_body.push_back(T);
  }

  std::string x_path;
  PoseGraph x_graph;
  std::map<long, std::size_t> x_keys;
};

void writePose(std::ostream& out, const Pose& T) {
  const Eigen::Quaterniond q(T.linear());
  for (const double value :
       {T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(), q.z(), q.w()})
    out << ' ' << value;
}

}  // namespace

PoseGraph readG2o(const std::string& path) { return Reader(path).read(); }

void writeG2o(const std::string& path, const std::vector<Pose>& poses, std::optional<std::size_t> held,
              const std::vector<G2oEdge>& edges) {
  std::ostringstream out;
  out << std::setprecision(std::numeric_limits<double>::max_digits10);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    out << "VERTEX_SE3:QUAT " << i;
    writePose(out, poses[i]);
    out << '\n';
  }
  if (held) out << "FIX " << *held << '\n';
  for (const G2oEdge& edge : edges) {
    out << "EDGE_SE3:QUAT " << edge.i << ' ' << edge.j;
    writePose(out, edge.T_i_j);
    for (int r = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c) out << ' ' << edge.information((r + 3) % 6, (c + 3) % 6);
    out << '\n';
  }
  writeTextFile(path, out.str());
}

std::size_t writeG2o(const std::string& path, const PoseGraph& graph) {
  std::vector<G2oEdge> edges;
  edges.reserve(graph.factors.size());
  for (const Factor& factor : graph.factors)
    if (const auto* between = std::get_if<BetweenFactor>(&factor))
      edges.push_back(
          {between->i, between->j, between->T_i_j, between->whitening.transpose() * between->whitening});
  writeG2o(path, graph.T_map_body, graph.held, edges);
  return graph.factors.size() - edges.size();
}

}  // namespace raceloc
