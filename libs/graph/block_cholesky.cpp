#include "graph/block_cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <array>
#include <new>
#include <stdexcept>

extern "C" {  // of <omp.h>, which only the compiler that CHOLMOD was built with has
int omp_get_max_active_levels();
void omp_set_max_active_levels(int levels);
}

namespace raceloc {

namespace {

constexpr int kBlock = 6;
/** So many of the newest poses are ordered last. */
constexpr std::size_t kNewest = 5;

/** A pivot that has lost all its digits. */
constexpr double kSingular = 1e-13;

using BlockMap = Eigen::Map<Matrix6d, 0, Eigen::OuterStride<>>;

/** CHOLMOD's Common, which every object of it needs until its end. */
struct Common : cholmod_common {
  Common() {
    cholmod_start(this);
    print = 0;
    nmethods = 1;
  }
  ~Common() { cholmod_finish(this); }
  Common(const Common&) = delete;
  Common& operator=(const Common&) = delete;
};

/** CHOLMOD shares the copying of small blocks among OpenMP's threads, which spin between them: on a busy machine
 * that takes longer than the copying. While one of these lives, it does it alone. */
class OneThread {
 public:
  OneThread() : x_levels(omp_get_max_active_levels()) { omp_set_max_active_levels(0); }
  ~OneThread() { omp_set_max_active_levels(x_levels); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int x_levels;
};

struct FreeSparse {
  Common* common;
  void operator()(cholmod_sparse* m) const { cholmod_free_sparse(&m, common); }
};
struct FreeDense {
  Common* common;
  void operator()(cholmod_dense* m) const { cholmod_free_dense(&m, common); }
};
struct FreeFactor {
  Common* common;
  void operator()(cholmod_factor* m) const { cholmod_free_factor(&m, common); }
};
using Sparse = std::unique_ptr<cholmod_sparse, FreeSparse>;
using Dense = std::unique_ptr<cholmod_dense, FreeDense>;
using Factorization = std::unique_ptr<cholmod_factor, FreeFactor>;

template <class T>
T* allocated(T* object) {  // CHOLMOD returns null where it has no memory
  if (!object) throw std::bad_alloc();
  return object;
}

int* columnsOf(cholmod_sparse& m) { return static_cast<int*>(m.p); }
int* rowsOf(cholmod_sparse& m) { return static_cast<int*>(m.i); }
double* valuesOf(cholmod_sparse& m) { return static_cast<double*>(m.x); }
double* valuesOf(cholmod_dense& m) { return static_cast<double*>(m.x); }

Sparse newSparse(Common& common, std::size_t rows, std::size_t columns, std::size_t entries, int symmetry,
                 int type) {
  return {allocated(cholmod_allocate_sparse(rows, columns, entries, 1, 1, symmetry, type, &common)),
          {&common}};
}

using Links = std::vector<std::pair<int, int>>;  ///< (column, row) with column < row, sorted, unique

Links below(Links links) {
  for (auto& [a, b] : links)
    if (a > b) std::swap(a, b);
  std::sort(links.begin(), links.end());
  links.erase(std::unique(links.begin(), links.end()), links.end());
  return links;
}

/** Poses in order of elimination. */
std::vector<int> ordering(Common& common, std::size_t poses, const Links& links, bool newest_last) {
  const auto pattern = newSparse(common, poses, poses, links.size(), -1, CHOLMOD_PATTERN);
  int* column = columnsOf(*pattern);
  std::fill(column, column + poses + 1, 0);
  for (std::size_t k = 0; k < links.size(); ++k) {
    ++column[links[k].first + 1];
    rowsOf(*pattern)[k] = links[k].second;
  }
  for (std::size_t i = 0; i < poses; ++i) column[i + 1] += column[i];
  std::vector<int> order(poses);
  if (newest_last && poses > kNewest) {
    std::vector<int> group(poses, 0);
    std::fill(group.end() - static_cast<std::ptrdiff_t>(kNewest), group.end(), 1);
    if (!cholmod_camd(pattern.get(), nullptr, 0, group.data(), order.data(), &common)) throw std::bad_alloc();
    return order;
  }
  common.method[0].ordering = CHOLMOD_AMD;
  common.postorder = 1;
  const Factorization symbolic(allocated(cholmod_analyze(pattern.get(), &common)), {&common});
  const int* first = static_cast<const int*>(symbolic->Perm);
  std::copy(first, first + poses, order.begin());
  return order;
}

}  // namespace

struct BlockCholesky::Store {
  Common common;
  std::size_t poses;         ///< in the factor
  bool spare;                ///< whether L is one that changes
  std::size_t capacity;      ///< and with its room; a pose to come is a row of the identity
  std::vector<int> place;    ///< of a pose in the order of elimination
  std::vector<int> pose_at;  ///< its inverse
  std::vector<int> first;    ///< of each place's blocks in `rows`
  std::vector<int> rows;     ///< places of the blocks of a column, ascending, the diagonal first
  Sparse H{nullptr, {&common}};
  Factorization L{nullptr, {&common}};
  /** \name The elimination tree of L's blocks, and what solveMoving() needs of each
   * @{ */
  std::vector<int> parent;                 ///< -1 at a root
  std::vector<std::vector<int>> children;  ///< those that got another parent meanwhile too
  std::vector<double> x;                   ///< zero between solves
  std::vector<char> seen, moving;          ///< likewise
  /** @} */
  double flops_whole = 0, flops_changed = 0;

  [[nodiscard]] int place_of(std::size_t pose) const {
    return pose < place.size() ? place[pose] : static_cast<int>(pose);
  }
  [[nodiscard]] std::size_t pose_of(int at) const {
    const auto i = static_cast<std::size_t>(at);
    return i < pose_at.size() ? static_cast<std::size_t>(pose_at[i]) : i;
  }
  [[nodiscard]] int blocksIn(int column) const {
    return first[static_cast<std::size_t>(column) + 1] - first[static_cast<std::size_t>(column)];
  }
  /** Block (row, column) of H; all blocks of a column lie in it one below the other. */
  BlockMap block(int row, int column) {
    const auto begin = rows.begin() + first[static_cast<std::size_t>(column)];
    const auto found = std::lower_bound(begin, begin + blocksIn(column), row);
    if (found == begin + blocksIn(column) || *found != row)
      throw std::out_of_range("BlockCholesky: a factor of poses that are not linked");
    const auto start =
        std::ptrdiff_t{first[static_cast<std::size_t>(column)]} * kBlock * kBlock + kBlock * (found - begin);
    return BlockMap(valuesOf(*H) + start, Eigen::OuterStride<>(kBlock * Eigen::Index{blocksIn(column)}));
  }
  /** The six columns of a block of L. What lies below it is whole blocks, the same in all six: H has whole blocks, and
   * so has all that is added. */
  struct Columns {
    std::array<const double*, kBlock> values;  ///< of column k: D, 5 - k of L within the block, then below it
    const int* rows;                           ///< below the block
    int size;                                  ///< how many, a multiple of six

    [[nodiscard]] Eigen::Map<const Vector6d> below(int k, int entry) const {
      return Eigen::Map<const Vector6d>(values[static_cast<std::size_t>(k)] + kBlock - k + entry);
    }
  };
  [[nodiscard]] Columns columns(int at) const {
    const auto first_column = kBlock * std::ptrdiff_t{at};
    const int* start = static_cast<const int*>(L->p) + first_column;
    Columns c{};
    for (std::size_t k = 0; k < kBlock; ++k) c.values[k] = static_cast<const double*>(L->x) + start[k];
    c.rows = static_cast<const int*>(L->i) + start[kBlock - 1] + 1;
    c.size = static_cast<const int*>(L->nz)[first_column + kBlock - 1] - 1;
    return c;
  }
  [[nodiscard]] int parentInL(int at) const {
    const Columns c = columns(at);
    const int* sizes = static_cast<const int*>(L->nz) + kBlock * std::ptrdiff_t{at};
    for (int k = 0; k < kBlock; ++k)
      if (c.size % kBlock != 0 || sizes[k] != c.size + kBlock - k)
        throw std::logic_error("BlockCholesky: a column of L is not of whole blocks");
    return c.size > 0 ? c.rows[0] / kBlock : -1;
  }
  int takeParent(int at) {
    const int now = parentInL(at);
    if (now >= 0 && now != parent[static_cast<std::size_t>(at)])
      children[static_cast<std::size_t>(now)].push_back(at);
    return parent[static_cast<std::size_t>(at)] = now;
  }
  void growTree() {
    parent.assign(capacity, -1);
    children.assign(capacity, {});
    x.assign(kBlock * capacity, 0);
    seen.assign(capacity, 0);
    moving.assign(capacity, 0);
    for (int at = 0; at < static_cast<int>(capacity); ++at) takeParent(at);
  }
  /** Tells the tree that blocks from `at` to the root may have got new rows. */
  void regrow(int at) {
    while (at >= 0) at = takeParent(at);
  }
  [[nodiscard]] Eigen::Map<Vector6d> xOf(int row) { return Eigen::Map<Vector6d>(x.data() + row); }
  /** L y = b in a block above which all is done, and off the rows below; then D z = y in it. */
  void eliminate(int at) {
    const Columns l = columns(at);
    auto y = xOf(kBlock * at);
    for (int k = 0; k < kBlock; ++k)
      for (int row = k + 1; row < kBlock; ++row)
        y(row) -= l.values[static_cast<std::size_t>(k)][row - k] * y(k);
    for (int entry = 0; entry < l.size; entry += kBlock) {
      auto b = xOf(l.rows[entry]);
      for (int k = 0; k < kBlock; ++k) b -= y(k) * l.below(k, entry);
    }
    for (int k = 0; k < kBlock; ++k) y(k) /= *l.values[static_cast<std::size_t>(k)];
  }
  /** L' x = z in a block whose ancestors' x are ready. */
  Vector6d substitute(int at) {
    const Columns l = columns(at);
    Vector6d result = xOf(kBlock * at);
    for (int entry = 0; entry < l.size; entry += kBlock) {
      const Vector6d known = xOf(l.rows[entry]);
      for (int k = 0; k < kBlock; ++k) result(k) -= l.below(k, entry).dot(known);
    }
    for (int k = kBlock - 1; k >= 0; --k)
      for (int row = k + 1; row < kBlock; ++row)
        result(k) -= l.values[static_cast<std::size_t>(k)][row - k] * result(row);
    xOf(kBlock * at) = result;
    return result;
  }
  [[nodiscard]] bool hangsFromMoving(int at) const {
    const Columns l = columns(at);
    for (int entry = 0; entry < l.size; entry += kBlock)
      if (moving[static_cast<std::size_t>(l.rows[entry] / kBlock)] != 0) return true;
    return false;
  }
};

BlockCholesky::BlockCholesky(std::size_t poses, const std::vector<std::pair<std::size_t, std::size_t>>& links,
                             std::size_t spare)
    : x_(std::make_unique<Store>()) {
  Common& common = x_->common;
  x_->poses = poses;
  x_->spare = spare > 0;
  x_->capacity = poses + spare;
  Links pairs;
  pairs.reserve(links.size());
  for (const auto& [i, j] : links) {
    if (i == j || i >= poses || j >= poses) throw std::out_of_range("BlockCholesky: a link of no two poses");
    pairs.emplace_back(static_cast<int>(i), static_cast<int>(j));
  }
  pairs = below(std::move(pairs));
  x_->pose_at = ordering(common, poses, pairs, spare > 0);
  x_->place.resize(poses);
  for (std::size_t k = 0; k < poses; ++k)
    x_->place[static_cast<std::size_t>(x_->pose_at[k])] = static_cast<int>(k);
  for (auto& [a, b] : pairs) {
    a = x_->place[static_cast<std::size_t>(a)];
    b = x_->place[static_cast<std::size_t>(b)];
  }
  pairs = below(std::move(pairs));

  x_->first = {0};
  auto pair = pairs.begin();
  for (int column = 0; column < static_cast<int>(x_->capacity); ++column) {
    x_->rows.push_back(column);
    for (; pair != pairs.end() && pair->first == column; ++pair) x_->rows.push_back(pair->second);
    x_->first.push_back(static_cast<int>(x_->rows.size()));
  }
  const std::size_t size = kBlock * x_->capacity;
  x_->H = newSparse(common, size, size, std::size_t{kBlock} * kBlock * x_->rows.size(), -1, CHOLMOD_REAL);
  int entry = 0;
  for (int column = 0; column < static_cast<int>(x_->capacity); ++column)
    for (int k = 0; k < kBlock; ++k) {
      columnsOf(*x_->H)[kBlock * column + k] = entry;
      for (int block = x_->first[static_cast<std::size_t>(column)];
           block < x_->first[static_cast<std::size_t>(column) + 1]; ++block)
        for (int row = 0; row < kBlock; ++row)
          rowsOf(*x_->H)[entry++] = kBlock * x_->rows[static_cast<std::size_t>(block)] + row;
    }
  columnsOf(*x_->H)[size] = entry;

  common.method[0].ordering = CHOLMOD_NATURAL;
  common.postorder = 0;  // the order above is one already
  common.supernodal = CHOLMOD_AUTO;
  x_->L = {allocated(cholmod_analyze(x_->H.get(), &common)), {&common}};
  x_->flops_whole = common.fl;
}

BlockCholesky::~BlockCholesky() = default;
BlockCholesky::BlockCholesky(BlockCholesky&&) noexcept = default;
BlockCholesky& BlockCholesky::operator=(BlockCholesky&&) noexcept = default;

void BlockCholesky::clear() {
  std::fill(valuesOf(*x_->H), valuesOf(*x_->H) + x_->H->nzmax, 0.0);
  for (std::size_t pose = x_->poses; pose < x_->capacity; ++pose) hold(pose);
}

void BlockCholesky::add(const LinearFactor& term) {
  const int i = x_->place_of(term.i);
  x_->block(i, i).noalias() += term.J_i.transpose() * term.J_i;
  if (term.j == kNoPose) return;
  const int j = x_->place_of(term.j);
  x_->block(j, j).noalias() += term.J_j.transpose() * term.J_j;
  if (i < j)
    x_->block(j, i).noalias() += term.J_j.transpose() * term.J_i;
  else
    x_->block(i, j).noalias() += term.J_i.transpose() * term.J_j;
}

void BlockCholesky::hold(std::size_t pose) {
  const int at = x_->place_of(pose);
  x_->block(at, at) += Matrix6d::Identity();
}

bool BlockCholesky::factorize(double damping) {
  if (damping > 0)
    for (int at = 0; at < static_cast<int>(x_->poses); ++at) x_->block(at, at).diagonal() *= 1 + damping;
  Common& common = x_->common;
  const OneThread alone;
  cholmod_factorize(x_->H.get(), x_->L.get(), &common);
  if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
  if (common.status != CHOLMOD_OK || x_->L->minor < x_->L->n) return false;
  if (x_->spare) {  // from now on L changes, and H is not needed any more
    cholmod_change_factor(CHOLMOD_REAL, 0, 0, 0, 0, x_->L.get(), &common);
    x_->H.reset();
    x_->growTree();
  }
  return true;
}

Eigen::VectorXd BlockCholesky::solve(const Eigen::VectorXd& b) const {
  Common& common = x_->common;
  const OneThread alone;
  const Dense rhs(allocated(cholmod_zeros(x_->L->n, 1, CHOLMOD_REAL, &common)), {&common});
  for (std::size_t pose = 0; pose < x_->poses; ++pose)
    Eigen::Map<Vector6d>(valuesOf(*rhs) + kBlock * std::ptrdiff_t{x_->place_of(pose)}) =
        b.segment<kBlock>(static_cast<Eigen::Index>(kBlock * pose));
  const Dense solution(allocated(cholmod_solve(CHOLMOD_A, x_->L.get(), rhs.get(), &common)), {&common});
  Eigen::VectorXd x(kBlock * static_cast<Eigen::Index>(x_->poses));
  for (std::size_t pose = 0; pose < x_->poses; ++pose)
    x.segment<kBlock>(static_cast<Eigen::Index>(kBlock * pose)) =
        Eigen::Map<const Vector6d>(valuesOf(*solution) + kBlock * std::ptrdiff_t{x_->place_of(pose)});
  return x;
}

std::size_t BlockCholesky::room() const { return x_->capacity - x_->poses; }

bool BlockCholesky::change(const std::vector<LinearFactor>& terms, bool up) {
  if (terms.empty()) return true;
  Common& common = x_->common;
  const auto C = newSparse(common, x_->L->n, kBlock * terms.size(),
                           std::size_t{2} * kBlock * kBlock * terms.size(), 0, CHOLMOD_REAL);
  int entry = 0, column = 0;
  for (const LinearFactor& term : terms) {
    std::array<std::pair<int, const Matrix6d*>, 2> blocks{
        {{x_->place_of(term.i), &term.J_i}, {-1, &term.J_j}}};
    if (term.j != kNoPose) blocks[1].first = x_->place_of(term.j);
    if (blocks[0].first > blocks[1].first) std::swap(blocks[0], blocks[1]);
    for (int row = 0; row < kBlock; ++row) {
      if (term.J_i.row(row).isZero(0) && term.J_j.row(row).isZero(0)) continue;
      columnsOf(*C)[column++] = entry;
      for (const auto& [at, J] : blocks)  // whole blocks, zeros and all: L's stay whole
        for (int k = 0; at >= 0 && k < kBlock; ++k) {
          rowsOf(*C)[entry] = kBlock * at + k;
          valuesOf(*C)[entry++] = (*J)(row, k);
        }
    }
  }
  columnsOf(*C)[column] = entry;
  C->ncol = static_cast<std::size_t>(column);
  const int ok = cholmod_updown(up, C.get(), x_->L.get(), &common);
  if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
  x_->flops_changed += common.modfl;
  if (!ok || common.status != CHOLMOD_OK) return false;
  for (const LinearFactor& term : terms)
    x_->regrow(term.j == kNoPose ? x_->place_of(term.i)
                                 : std::min(x_->place_of(term.i), x_->place_of(term.j)));
  return true;
}

bool BlockCholesky::append(const Matrix6d& diagonal,
                           const std::vector<std::pair<std::size_t, Matrix6d>>& columns) {
  Common& common = x_->common;
  const int at = static_cast<int>(x_->poses);
  if (room() == 0) throw std::logic_error("BlockCholesky: no room for another pose");
  std::vector<std::pair<int, const Matrix6d*>> blocks;
  blocks.reserve(columns.size());
  for (const auto& [pose, H] : columns) blocks.emplace_back(x_->place_of(pose), &H);
  std::sort(blocks.begin(), blocks.end());
  const auto R = newSparse(common, x_->L->n, 1, kBlock * (blocks.size() + 1), 0, CHOLMOD_REAL);
  for (int k = 0; k < kBlock; ++k) {
    int entry = 0;
    for (const auto& [row, H] : blocks)
      for (int r = 0; r < kBlock; ++r) {
        rowsOf(*R)[entry] = kBlock * row + r;
        valuesOf(*R)[entry++] = (*H)(r, k);
      }
    for (int r = 0; r <= k; ++r) {
      rowsOf(*R)[entry] = kBlock * at + r;
      valuesOf(*R)[entry++] = diagonal(r, k);
    }
    columnsOf(*R)[0] = 0;
    columnsOf(*R)[1] = entry;
    const int ok = cholmod_rowadd(kBlock * static_cast<std::size_t>(at) + static_cast<std::size_t>(k),
                                  R.get(), x_->L.get(), &common);
    if (common.status == CHOLMOD_OUT_OF_MEMORY) throw std::bad_alloc();
    x_->flops_changed += common.modfl;
    if (!ok || common.status != CHOLMOD_OK) return false;
    const double* D =
        static_cast<const double*>(x_->L->x) + static_cast<const int*>(x_->L->p)[kBlock * at + k];
    if (!(*D > kSingular * diagonal(k, k))) return false;
  }
  for (const auto& [row, H] : blocks) x_->regrow(row);
  ++x_->poses;
  return true;
}

void BlockCholesky::solveMoving(const std::vector<std::pair<std::size_t, Vector6d>>& b,
                                const Visit& visit) const {
  std::vector<int> order;  // of the blocks, ancestors first
  for (const auto& [pose, value] : b) {
    int at = x_->place_of(pose);
    x_->xOf(kBlock * at) = value;
    for (; at >= 0 && !x_->seen[static_cast<std::size_t>(at)];
         at = x_->parent[static_cast<std::size_t>(at)]) {
      x_->seen[static_cast<std::size_t>(at)] = 1;
      order.push_back(at);
    }
  }
  std::sort(order.begin(), order.end());
  for (const int at : order) x_->eliminate(at);
  std::reverse(order.begin(), order.end());

  const auto solve = [&](int at) {
    x_->moving[static_cast<std::size_t>(at)] = visit(x_->pose_of(at), x_->substitute(at));
  };
  for (const int at : order) solve(at);
  for (std::size_t k = 0; k < order.size(); ++k) {  // `order` grows below what moves
    const auto at = static_cast<std::size_t>(order[k]);
    if (!x_->moving[at] && !x_->hangsFromMoving(order[k])) continue;
    auto& children = x_->children[at];
    const auto gone = [&](int child) { return x_->parent[static_cast<std::size_t>(child)] != order[k]; };
    children.erase(std::remove_if(children.begin(), children.end(), gone), children.end());
    for (const int child : children)
      if (!x_->seen[static_cast<std::size_t>(child)] && x_->hangsFromMoving(child)) {
        x_->seen[static_cast<std::size_t>(child)] = 1;
        order.push_back(child);
        solve(child);
      }
  }
  for (const int at : order) {
    x_->xOf(kBlock * at).setZero();
    x_->seen[static_cast<std::size_t>(at)] = x_->moving[static_cast<std::size_t>(at)] = 0;
  }
}

Matrix6d BlockCholesky::inverseBlock(std::size_t pose) const {
  Matrix6d block;
  for (int k = 0; k < kBlock; ++k)
    solveMoving({{pose, Vector6d::Unit(k)}}, [&](std::size_t reached, const Vector6d& x) {
      if (reached == pose) block.col(k) = x;
      return false;
    });
  return 0.5 * (block + block.transpose());
}

double BlockCholesky::flopsWhole() const { return x_->flops_whole; }
double BlockCholesky::flopsChanged() const { return x_->flops_changed; }

}  // namespace raceloc
