/** \file
 * The bodies of core/ as kernels. The host keeps the master of every voxel map and runs the Gauss-Newton
 * loop; a pass costs two launches and one transfer of its sums. */
#include <algorithm>
#include <array>
#include <type_traits>

#include "api/voxel_table.hpp"
#include "core/backend.hpp"
#include "core/weight.hpp"
#include "cuda/device_array.hpp"
#include "cuda/sort_scan.hpp"
#include "kernels/covariance.kernel.hpp"
#include "kernels/sorted_runs.kernel.hpp"
#include "kernels/vgicp.kernel.hpp"

namespace raceloc::gpu {

namespace {

RACELOC_KERNEL(simt::kWarp)
testLaunch(std::uint32_t* answer) { answer[simt::lane()] = 3 * simt::lane() + 1; }

std::uint32_t blocksFor(std::size_t n, int threads) {
  return static_cast<std::uint32_t>((n + static_cast<std::size_t>(threads) - 1) /
                                    static_cast<std::size_t>(threads));
}

void checkLaunch(const char* kernel) { checkCuda(cudaGetLastError(), kernel); }

class Stream {
 public:
  Stream() {
    checkCuda(cudaStreamCreateWithFlags(&x_stream, cudaStreamNonBlocking), "cudaStreamCreateWithFlags");
  }
  ~Stream() { cudaStreamDestroy(x_stream); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  [[nodiscard]] cudaStream_t get() const { return x_stream; }
  void wait() const { checkCuda(cudaStreamSynchronize(x_stream), "cudaStreamSynchronize"); }

 private:
  cudaStream_t x_stream = nullptr;
};

class CudaMirror : public MapMirror {
 public:
  explicit CudaMirror(int device) : x_device(device) {}

  void upload(const VoxelTable& table) override {
    checkCuda(cudaSetDevice(x_device), "cudaSetDevice");
    x_view = {x_slots.upload(table.slots().data(), table.slots().size(), nullptr),
              x_records.upload(table.records().data(), table.records().size(), nullptr), table.shift()};
    checkCuda(cudaDeviceSynchronize(), "cudaDeviceSynchronize");
  }

  [[nodiscard]] const VoxelMapView& view() const { return x_view; }
  [[nodiscard]] int device() const { return x_device; }

 private:
  int x_device;
  DeviceArray<VoxelSlot> x_slots;
  DeviceArray<VoxelRecord> x_records;
  VoxelMapView x_view{};
};

struct PointBuffers {
  DeviceArray<float> x, y, z;

  PointsView upload(const PointsView& p, cudaStream_t stream) {
    return {x.upload(p.x, p.size, stream), y.upload(p.y, p.size, stream), z.upload(p.z, p.size, stream),
            p.size};
  }
};

struct CovarianceBuffers {
  DeviceArray<float> xx, xy, xz, yy, yz, zz;
  DeviceArray<std::int32_t> neighbours;

  CovariancesView upload(const CovariancesView& C, cudaStream_t s) {
    return {xx.upload(C.xx, C.size, s),
            xy.upload(C.xy, C.size, s),
            xz.upload(C.xz, C.size, s),
            yy.upload(C.yy, C.size, s),
            yz.upload(C.yz, C.size, s),
            zz.upload(C.zz, C.size, s),
            C.size};
  }
  CovariancesOut room(std::size_t n) {
    return {xx.room(n), xy.room(n), xz.room(n), yy.room(n), yz.room(n), zz.room(n), neighbours.room(n)};
  }
};

/** A context's stream and buffers. */
struct Device {
  int number;
  Stream stream;
  PointBuffers points, sorted;
  CovarianceBuffers covariances;
  SortBuffers sort;
  DeviceArray<std::uint64_t> cell_keys;
  DeviceArray<std::uint32_t> cell_first;
  DeviceArray<Run> runs;
  DeviceArray<std::int32_t> pairs[2];
  DeviceArray<double> partials, sums;

  void select() const { checkCuda(cudaSetDevice(number), "cudaSetDevice"); }
};

class CudaPasses : public PassRunner {
 public:
  CudaPasses(Device& device, const PointsView& source, const CovariancesView& covariances,
             const VoxelTable& table, const CudaMirror& mirror, const MatchOptions& options)
      : x_device(device), x_voxel_size_m(table.voxelSize()), x_options(options) {
    const cudaStream_t stream = device.stream.get();
    const std::size_t pairs = source.size * static_cast<std::size_t>(options.neighbour_voxels);
    x_input.points = device.points.upload(source, stream);
    x_input.covariances = device.covariances.upload(covariances, stream);
    x_input.map = mirror.view();
    x_input.fresh = device.pairs[0].room(pairs);
    x_spare = device.pairs[1].room(pairs);
    x_blocks = blocksFor(source.size, kPassThreads);
    device.partials.room(static_cast<std::size_t>(x_blocks) * kSums);
    device.sums.room(kSums);
  }

  Pass run(const Transform& T_map_source) override {
    Pass pass;
    if (x_blocks == 0) return pass;
    x_device.select();
    const cudaStream_t stream = x_device.stream.get();
    x_input.setup = passSetup(T_map_source, x_voxel_size_m, x_options);
    vgicpPass<<<x_blocks, kPassThreads, 0, stream>>>(x_input, x_device.partials.data());
    checkLaunch("vgicpPass");
    addPartials<<<1, simt::kWarp, 0, stream>>>(x_device.partials.data(), x_blocks, x_device.sums.data());
    checkLaunch("addPartials");
    x_device.sums.download(pass.sums.data(), kSums, stream);
    x_device.stream.wait();
    return pass;
  }

  void freeze() override {
    x_input.frozen = x_input.fresh;
    std::swap(x_input.fresh, x_spare);
  }

 private:
  Device& x_device;
  double x_voxel_size_m;
  MatchOptions x_options;
  PassInput x_input{};
  std::int32_t* x_spare = nullptr;
  std::uint32_t x_blocks = 0;
};

class CudaBackend : public BackendBase {
 public:
  CudaBackend(int device, std::string description)
      : x_device{device, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}}, x_description(std::move(description)) {
    std::array<std::uint32_t, simt::kWarp> answer{};
    DeviceArray<std::uint32_t> there;
    testLaunch<<<1, simt::kWarp, 0, x_device.stream.get()>>>(there.room(answer.size()));
    checkLaunch("test launch");
    there.download(answer.data(), answer.size(), x_device.stream.get());
    x_device.stream.wait();
    for (std::uint32_t i = 0; i < answer.size(); ++i) {
      if (answer[i] != 3 * i + 1) throw DeviceError("test launch: a wrong answer from " + x_description);
    }
  }

  [[nodiscard]] Backend kind() const override { return Backend::cuda; }
  [[nodiscard]] std::string description() const override { return x_description; }
  std::unique_ptr<MapMirror> mirror() override { return std::make_unique<CudaMirror>(x_device.number); }

  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped) override {
    const VoxelExtent extent = voxelExtent(points, voxel_size_m);
    const auto n = static_cast<std::uint32_t>(points.size), kept = static_cast<std::uint32_t>(extent.kept);
    dropped = points.size - extent.kept;
    Points out;
    if (kept == 0) return out;
    x_device.select();
    const cudaStream_t stream = x_device.stream.get();
    const PointsView p = x_device.points.upload(points, stream);
    SortBuffers& sort = x_device.sort;
    voxelKeys<<<blocksFor(n, kRunThreads), kRunThreads, 0, stream>>>(p, extent.layout, voxel_size_m,
                                                                     sort.keys.room(n), sort.order.room(n));
    checkLaunch("voxelKeys");
    sortPairs(sort, n, extent.layout.bits + 1, stream);  // one bit more: dropped points come last
    const std::uint32_t voxels = numberedRuns(kept);
    float *x = x_device.sorted.x.room(voxels), *y = x_device.sorted.y.room(voxels),
          *z = x_device.sorted.z.room(voxels);
    centroids<<<blocksFor(kept, kRunThreads), kRunThreads, 0, stream>>>(
        p, sort.keys_sorted.data(), sort.order_sorted.data(), sort.numbers.data(), kept, x, y, z);
    checkLaunch("centroids");
    out.x.resize(voxels), out.y.resize(voxels), out.z.resize(voxels);
    x_device.sorted.x.download(out.x.data(), voxels, stream);
    x_device.sorted.y.download(out.y.data(), voxels, stream);
    x_device.sorted.z.download(out.z.data(), voxels, stream);
    x_device.stream.wait();
    return out;
  }

  Covariances covariances(const PointsView& points, const CovarianceOptions& options) override {
    Covariances out;
    const auto n = static_cast<std::uint32_t>(points.size);
    if (n == 0) return out;
    x_device.select();
    const cudaStream_t stream = x_device.stream.get();
    const NeighbourGrid grid = NeighbourGrid::over(points, options.radius_m);
    const PointsView p = x_device.points.upload(points, stream);
    SortBuffers& sort = x_device.sort;
    cellKeys<<<blocksFor(n, kRunThreads), kRunThreads, 0, stream>>>(p, grid, sort.keys.room(n),
                                                                    sort.order.room(n));
    checkLaunch("cellKeys");
    sortPairs(sort, n, grid.layout.bits, stream);
    const std::uint32_t cells = numberedRuns(n);
    PointBuffers& s = x_device.sorted;
    std::uint64_t* cell_keys = x_device.cell_keys.room(cells);
    std::uint32_t* cell_first = x_device.cell_first.room(cells);
    listCells<<<blocksFor(n, kRunThreads), kRunThreads, 0, stream>>>(
        p, sort.keys_sorted.data(), sort.order_sorted.data(), sort.numbers.data(), cell_keys, cell_first,
        s.x.room(n), s.y.room(n), s.z.room(n));
    checkLaunch("listCells");
    const std::size_t rows = static_cast<std::size_t>(cells) * kRowsAround;
    Run* runs = x_device.runs.room(rows);
    findRuns<<<blocksFor(rows, kRunThreads), kRunThreads, 0, stream>>>(grid, cell_keys, cell_first, cells, n,
                                                                       runs);
    checkLaunch("findRuns");
    const PointsView sorted{s.x.data(), s.y.data(), s.z.data(), n};
    const CovariancesOut there = x_device.covariances.room(n);
    withWeight<float>(options, [&](const auto& weightOf) {
      covarianceOfPoints<<<blocksFor(n, kCovarianceThreads), kCovarianceThreads, 0, stream>>>(
          sorted, sort.order_sorted.data(), sort.numbers.data(), runs, CovarianceSetup::of(options), weightOf,
          there);
    });
    checkLaunch("covarianceOfPoints");
    const auto fetch = [&](const auto& from, auto& to) {
      to.resize(n);
      from.download(to.data(), n, stream);
    };
    const CovarianceBuffers& C = x_device.covariances;
    fetch(C.xx, out.xx), fetch(C.xy, out.xy), fetch(C.xz, out.xz);
    fetch(C.yy, out.yy), fetch(C.yz, out.yz), fetch(C.zz, out.zz);
    fetch(C.neighbours, out.neighbours);
    x_device.stream.wait();
    return out;
  }

  std::unique_ptr<PassRunner> passes(const PointsView& source, const CovariancesView& covariances,
                                     const VoxelTable& table, const MapMirror* mirror,
                                     const MatchOptions& options) override {
    const auto* here = dynamic_cast<const CudaMirror*>(mirror);
    if (here == nullptr || here->device() != x_device.number)
      throw std::invalid_argument("the voxel map was made by the context of another device");
    x_device.select();
    return std::make_unique<CudaPasses>(x_device, source, covariances, table, *here, options);
  }

 private:
  /** Numbers the runs of the first n sorted keys; returns how many there are. */
  std::uint32_t numberedRuns(std::uint32_t n) {
    const cudaStream_t stream = x_device.stream.get();
    SortBuffers& sort = x_device.sort;
    markHeads<<<blocksFor(n, kRunThreads), kRunThreads, 0, stream>>>(sort.keys_sorted.data(), n,
                                                                     sort.heads.room(n));
    checkLaunch("markHeads");
    numberRuns(sort, n, stream);
    std::uint32_t runs = 0;
    checkCuda(
        cudaMemcpyAsync(&runs, sort.numbers.data() + n - 1, sizeof(runs), cudaMemcpyDeviceToHost, stream),
        "cudaMemcpyAsync");
    x_device.stream.wait();
    return runs;
  }

  Device x_device;
  std::string x_description;
};

}  // namespace

std::unique_ptr<BackendBase> makeCudaBackend(int device) {
  int devices = 0;
  checkCuda(cudaGetDeviceCount(&devices), "cudaGetDeviceCount");
  if (device < 0 || device >= devices)
    throw DeviceError("CUDA device " + std::to_string(device) + " of " + std::to_string(devices) +
                      " does not exist");
  cudaDeviceProp properties{};
  checkCuda(cudaGetDeviceProperties(&properties, device), "cudaGetDeviceProperties");
  const std::string capability = std::to_string(properties.major) + "." + std::to_string(properties.minor);
  const std::string name =
      "CUDA device " + std::to_string(device) + ", " + properties.name + ", capability " + capability;
  if (10 * properties.major + properties.minor < 75) throw DeviceError(name + ": 7.5 or newer is needed");
  checkCuda(cudaSetDevice(device), "cudaSetDevice");
  return std::make_unique<CudaBackend>(device, name);
}

}  // namespace raceloc::gpu
