#include "pipeline/line_stream.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/errors.h"

namespace raceloc {

namespace {

InputError bad(const std::string& url, const std::string& what) {
  return InputError("ini section [live]: stream = " + url + ": " + what);
}

struct UrlParts {
  bool is_tcp;
  std::string host, port;  ///< the port is of one to five digits
};

UrlParts partsOf(const std::string& url) {
  constexpr std::size_t kScheme = 6;  // characters of udp:// and tcp://
  const std::string scheme = url.substr(0, kScheme);
  const std::size_t colon = url.find(':', kScheme);
  const bool is_whole =
      (scheme == "udp://" || scheme == "tcp://") && colon != std::string::npos && colon > kScheme;
  const std::string host = is_whole ? url.substr(kScheme, colon - kScheme) : "";
  const std::string port = is_whole ? url.substr(colon + 1) : "";
  const bool is_port =
      !port.empty() && port.size() <= 5 && port.find_first_not_of("0123456789") == std::string::npos;
  if (!is_port || host.find('/') != std::string::npos)
    throw bad(url, "it must be udp://HOST:PORT or tcp://HOST:PORT");
  return {scheme == "tcp://", host, port};
}

sockaddr_in addressOf(const std::string& url, const std::string& host, const std::string& port) {
  addrinfo wanted{}, *found = nullptr;
  wanted.ai_family = AF_INET;
  if (const int error = getaddrinfo(host.c_str(), port.c_str(), &wanted, &found); error != 0)
    throw bad(url, "host " + host + " is not known (" + gai_strerror(error) +
                       "); give an address such as 127.0.0.1");
  sockaddr_in address{};
  std::memcpy(&address, found->ai_addr, sizeof address);
  freeaddrinfo(found);
  return address;
}

}  // namespace

LineStream::LineStream(const std::string& url) : x_url(url) {
  const auto [is_tcp, host, port] = partsOf(url);
  x_is_tcp = is_tcp;
  if (std::stoi(port) > 65535 || (!x_is_tcp && std::stoi(port) == 0))
    throw bad(url, "there is no port " + port);
  sockaddr_in address = addressOf(url, host, port);
  auto* const peer = reinterpret_cast<sockaddr*>(&address);
  x_socket = ::socket(AF_INET, (x_is_tcp ? SOCK_STREAM : SOCK_DGRAM) | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  const int on = 1;
  constexpr int kMostWaiting = 16;
  socklen_t size = sizeof address;
  const bool ready =
      x_socket >= 0 &&
      (x_is_tcp ? setsockopt(x_socket, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) == 0 &&
                      ::bind(x_socket, peer, size) == 0 && ::listen(x_socket, kMostWaiting) == 0 &&
                      getsockname(x_socket, peer, &size) == 0
                : ::connect(x_socket, peer, size) == 0);
  if (!ready) {
    const std::string reason = std::strerror(errno);
    if (x_socket >= 0) ::close(x_socket);
    throw bad(url, std::string(x_is_tcp ? "cannot listen there" : "cannot send there") + " (" + reason + ")");
  }
  if (x_is_tcp) x_url = "tcp://" + host + ":" + std::to_string(ntohs(address.sin_port));
}

LineStream::~LineStream() {
  for (const int client : x_clients) ::close(client);
  ::close(x_socket);
}

void LineStream::accept() {
  constexpr std::size_t kMostClients = 16;
  while (x_clients.size() < kMostClients) {
    const int client = ::accept4(x_socket, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (client < 0) return;
    const int on = 1;
    setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);  // a pose is worth nothing later
    x_clients.push_back(client);
  }
}

void LineStream::send(const std::string& line) {
  const std::string text = line + "\n";
  const auto isSent = [&](int socket) {
    errno = 0;
    return ::send(socket, text.data(), text.size(), MSG_DONTWAIT | MSG_NOSIGNAL) ==
           static_cast<ssize_t>(text.size());
  };
  if (!x_is_tcp) {
    if (!isSent(x_socket)) ++x_lost;
    return;
  }
  accept();
  const auto gone = std::remove_if(x_clients.begin(), x_clients.end(), [&](int client) {
    if (isSent(client)) return false;
    const bool left = errno == EPIPE || errno == ECONNRESET;  // of its own accord
    if (!left) ++x_lost;
    ::close(client);
    return true;
  });
  x_clients.erase(gone, x_clients.end());
}

}  // namespace raceloc
