#include "sensors/vehicle_datagrams.h"

#include <mrpt/obs/CObservation.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <sstream>
#include <system_error>
#include <utility>

#include "sensors/sample_conversion.h"

namespace raceloc {

namespace {

class Socket {
 public:
  explicit Socket(int port) : x_socket(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_ANY);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    if (x_socket >= 0 && ::bind(x_socket, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0) return;
    const int error = errno;
    if (x_socket >= 0) ::close(x_socket);
    throw std::system_error(error, std::generic_category());
  }
  ~Socket() { ::close(x_socket); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void waitFor(int longest_ms) const {
    pollfd ready{x_socket, POLLIN, 0};
    (void)::poll(&ready, 1, longest_ms);
  }
  /** The next datagram; none when no more is there. */
  [[nodiscard]] std::optional<std::string> next() const {
    std::array<char, 512> text{};
    const auto size = ::recv(x_socket, text.data(), text.size(), 0);
    return size < 0 ? std::nullopt : std::optional(std::string(text.data(), static_cast<std::size_t>(size)));
  }

 private:
  int x_socket;
};

std::optional<MotionSample> motionIn(const std::string& datagram, const std::string& label) {
  std::istringstream words(datagram);
  words.imbue(std::locale::classic());
  MotionSample motion{0, label, 0, 0};
  if (!(words >> motion.stamp_s >> motion.speed_mps >> motion.yaw_rate_rps)) return std::nullopt;
  if (double steering_rad = 0; words >> steering_rad) motion.steering_rad = steering_rad;
  return motion;
}

}  // namespace

Feed vehicleDatagrams(const std::string& label, int port) {
  const auto poll = [socket = std::make_shared<Socket>(port),
                     label](std::vector<Arrival>& arrivals) -> std::optional<SteadyTime> {
    constexpr int kLongest_ms = 20;
    constexpr int kMostAtOnce = 1000;  // whoever floods the port does not keep us from the end
    socket->waitFor(kLongest_ms);
    for (int i = 0; i < kMostAtOnce; ++i) {
      const auto datagram = socket->next();
      if (!datagram) break;
      if (const auto motion = motionIn(*datagram, label))
        for (auto& observation : toObservations(*motion)) arrivals.push_back(std::move(observation));
    }
    return std::chrono::steady_clock::now();
  };
  return {label, poll};
}

}  // namespace raceloc
