/** \file
 * Lines of text to whoever listens, over UDP or TCP. */
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace raceloc {

/** Sends lines, and never waits for anyone. What cannot be sent at once is lost and counted: over UDP the line, over
 * TCP the listener with it, since half a line would spoil the rest. */
class LineStream {
 public:
  /** \param url `udp://HOST:PORT`: lines go there, one a datagram; `tcp://HOST:PORT`: it listens there, for several
   * clients (port 0: one that is free); HOST is an address of IPv4 or a name
   * \throws InputError for an url that is neither, a host that nobody knows, a port that is taken */
  explicit LineStream(const std::string& url);
  ~LineStream();
  LineStream(const LineStream&) = delete;
  LineStream& operator=(const LineStream&) = delete;

  /** \param line  without its end */
  void send(const std::string& line);

  [[nodiscard]] const std::string& url() const { return x_url; }            ///< with the port that it has
  [[nodiscard]] std::size_t listeners() const { return x_clients.size(); }  ///< of TCP
  [[nodiscard]] std::size_t lost() const { return x_lost; }                 ///< lines (UDP) or clients (TCP)

 private:
  void accept();

  std::string x_url;
  bool x_is_tcp;
  int x_socket = -1;  ///< that sends, or that listens
  std::vector<int> x_clients;
  std::size_t x_lost = 0;
};

}  // namespace raceloc
