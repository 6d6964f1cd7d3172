/** \file
 * kernels/ for CUDA devices. */
#include "cuda/machine.hpp"
#include "kernels/device_backend.hpp"

namespace raceloc::gpu {

std::string CudaMachine::description() const {
  cudaDeviceProp properties{};
  checkCuda(cudaGetDeviceProperties(&properties, x_device), "cudaGetDeviceProperties");
  return "CUDA device " + std::to_string(x_device) + ", " + properties.name + ", capability " +
         std::to_string(properties.major) + "." + std::to_string(properties.minor);
}

std::unique_ptr<BackendBase> makeCudaBackend(int device) {
  int devices = 0;
  checkCuda(cudaGetDeviceCount(&devices), "cudaGetDeviceCount");
  if (device < 0 || device >= devices)
    throw DeviceError("CUDA device " + std::to_string(device) + " of " + std::to_string(devices) +
                      " does not exist");
  int major = 0, minor = 0;
  checkCuda(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device),
            "cudaDeviceGetAttribute");
  checkCuda(cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, device),
            "cudaDeviceGetAttribute");
  if (10 * major + minor < 75)
    throw DeviceError("CUDA device " + std::to_string(device) + " has capability " + std::to_string(major) +
                      "." + std::to_string(minor) + ": 7.5 or newer is needed");
  return std::make_unique<DeviceBackend<CudaMachine>>(device);
}

}  // namespace raceloc::gpu
