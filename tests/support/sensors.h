/** \file
 * The far ends of sensors' cables. */
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <pty.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/wait.h"

namespace raceloc::test {

/** A serial line (a pseudo terminal); the test is the receiver at its end. */
class SerialLine {
 public:
  SerialLine() {
    std::array<char, 256> name{};
    if (openpty(&x_receiver, &x_computer, name.data(), nullptr, nullptr) != 0)
      throw std::runtime_error("no pseudo terminal");
    x_port = name.data();
  }
  SerialLine(const SerialLine&) = delete;
  SerialLine& operator=(const SerialLine&) = delete;
  ~SerialLine() {
    close(x_receiver);
    close(x_computer);
  }
  [[nodiscard]] const std::string& port() const { return x_port; }
  /** An NMEA sentence, which gets its `$`, sum and end. */
  void send(const std::string& body) const {
    unsigned sum = 0;
    for (const char c : body) sum ^= static_cast<unsigned char>(c);
    std::array<char, 8> end{};
    std::snprintf(end.data(), end.size(), "*%02X\r\n", sum & 0xFFU);
    const std::string line = "$" + body + end.data();
    if (write(x_receiver, line.data(), line.size()) != static_cast<ssize_t>(line.size()))
      throw std::runtime_error("the serial line is full");
  }

 private:
  int x_receiver = -1, x_computer = -1;
  std::string x_port;
};

/** A UDP socket on the loopback. */
class UdpSocket {
 public:
  UdpSocket() : x_socket(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    if (bind(x_socket, reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        getsockname(x_socket, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("no UDP socket");
    x_port = ntohs(address.sin_port);
  }
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;
  ~UdpSocket() { close(x_socket); }
  [[nodiscard]] int port() const { return x_port; }
  [[nodiscard]] int handle() const { return x_socket; }
  void send(const std::vector<char>& packet, int port) const {
    const sockaddr_in address = loopback(port);
    (void)sendto(x_socket, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&address),
                 sizeof address);
  }

 private:
  static sockaddr_in loopback(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    return address;
  }
  int x_socket, x_port = 0;
};

/** A port that was free just now. */
inline int freeUdpPort() { return UdpSocket().port(); }

/** Bytes that wait for whoever listens on a UDP port. */
inline long waitingBytes(int port) {
  std::ifstream table("/proc/net/udp");
  std::array<char, 8> hex{};
  std::snprintf(hex.data(), hex.size(), ":%04X", static_cast<unsigned>(port));
  for (std::string line; std::getline(table, line);) {
    std::istringstream words(line);
    std::string number, local, remote, state, queues;
    words >> number >> local >> remote >> state >> queues;
    if (local.size() > 5 && local.substr(local.size() - 5) == hex.data())
      return std::stol(queues.substr(queues.find(':') + 1), nullptr, 16);
  }
  return 0;
}

/** The packets of a Velodyne capture (classic pcap, little-endian), sent again. */
class VelodyneReplay {
 public:
  explicit VelodyneReplay(const std::string& pcap_path) {
    std::ifstream in(pcap_path, std::ios::binary);
    in.ignore(24);
    constexpr std::uint32_t kHeaders = 42;  // Ethernet, IP, UDP
    for (std::array<std::uint32_t, 4> record{};
         in.read(reinterpret_cast<char*>(record.data()), sizeof record);) {
      std::vector<char> packet(record[2]);
      in.read(packet.data(), static_cast<std::streamsize>(packet.size()));
      if (packet.size() > kHeaders) x_packets.emplace_back(packet.begin() + kHeaders, packet.end());
    }
  }
  /** Never more at once than the socket's buffer holds. */
  void sendAll(int data_port, int position_port) const {
    constexpr std::size_t kDataBytes = 1206;
    constexpr long kMostWaiting = 50'000;  // of 208 kB by default
    for (const auto& packet : x_packets) {
      x_socket.send(packet, packet.size() == kDataBytes ? data_port : position_port);
      if (!comesTrue([&] { return waitingBytes(data_port) < kMostWaiting; }))
        throw std::runtime_error("nobody takes the packets");
    }
  }

 private:
  UdpSocket x_socket;
  std::vector<std::vector<char>> x_packets;
};

}  // namespace raceloc::test
