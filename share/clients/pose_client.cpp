// Prints the poses that raceloc-live sends: pose_client udp://HOST:PORT | tcp://HOST:PORT [COUNT]
// With udp it listens on that address (port 0: a free one, named on stderr), with tcp it connects to it. Ends after COUNT
// lines, or when raceloc-live has ended the connection. HOST is an IPv4 address.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace {

// The number behind "key": in a line. Enough for this format, in which no key is part of another's name;
// a program with a JSON library at hand has better.
double number(const std::string& line, const std::string& key) {
  const auto at = line.find("\"" + key + "\":");
  if (at == std::string::npos) return NAN;
  const char* begin = line.c_str() + at + key.size() + 3;
  char* end = nullptr;
  const double value = std::strtod(begin, &end);
  return end == begin ? NAN : value;  // null
}

std::string word(const std::string& line, const std::string& key) {
  const std::string name = "\"" + key + "\":\"";
  const auto at = line.find(name);
  if (at == std::string::npos) return "";
  const auto begin = at + name.size();
  return line.substr(begin, line.find('"', begin) - begin);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string url = argc > 1 ? argv[1] : "";
  const auto colon = url.rfind(':');
  const bool is_udp = url.rfind("udp://", 0) == 0;
  if ((!is_udp && url.rfind("tcp://", 0) != 0) || colon < 7) {
    std::fprintf(stderr, "usage: pose_client udp://HOST:PORT | tcp://HOST:PORT [COUNT]\n");
    return 2;
  }
  const long count = argc > 2 ? std::strtol(argv[2], nullptr, 10) : 0;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(std::strtol(url.c_str() + colon + 1, nullptr, 10)));
  const int connection = socket(AF_INET, is_udp ? SOCK_DGRAM : SOCK_STREAM, 0);
  auto* const peer = reinterpret_cast<sockaddr*>(&address);
  socklen_t size = sizeof address;
  if (inet_pton(AF_INET, url.substr(6, colon - 6).c_str(), &address.sin_addr) != 1 ||
      (is_udp ? bind(connection, peer, size) : connect(connection, peer, size)) != 0) {
    std::perror(url.c_str());
    return 1;
  }
  if (is_udp && getsockname(connection, peer, &size) == 0)
    std::fprintf(stderr, "listening on %s:%d\n", url.substr(0, colon).c_str(), ntohs(address.sin_port));

  std::string text;  // what has come of lines that are not whole yet
  std::array<char, 65536> block{};
  for (long lines = 0;;) {
    const auto came = recv(connection, block.data(), block.size(), 0);
    if (came <= 0) break;
    text.append(block.data(), static_cast<std::size_t>(came));
    for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n')) {
      const std::string line = text.substr(0, end);
      text.erase(0, end + 1);
      std::printf("%.3f age %.3f x %.3f y %.3f yaw %.4f %s %s\n", number(line, "stamp_s"),
                  number(line, "age_s"), number(line, "x_m"), number(line, "y_m"), number(line, "yaw_rad"),
                  word(line, "state").c_str(), word(line, "cause").c_str());
      std::fflush(stdout);
      if (++lines == count) {
        close(connection);
        return 0;
      }
    }
  }
  close(connection);
  return 0;
}
