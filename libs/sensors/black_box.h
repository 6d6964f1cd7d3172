/** \file
 * Everything that came in, in the order in which it was taken. */
#pragma once

#include <cstddef>
#include <exception>
#include <memory>
#include <string>
#include <thread>

#include "core/bounded_queue.h"
#include "sensors/live_source.h"
#include "sensors/rawlog.h"

namespace raceloc {

/** Records to a rawlog without compression, on a thread of its own: a slow disk does not hold up the car before many
 * observations wait for it. The file appears under its name with commit(); after a power cut the temporary one,
 * `NAME.part.rawlog`, can be read up to where it is cut. */
class BlackBox {
 public:
  /** \throws InputError if the file cannot be written. */
  BlackBox(const std::string& path, const LogHeader& header);
  ~BlackBox();
  BlackBox(const BlackBox&) = delete;
  BlackBox& operator=(const BlackBox&) = delete;

  /** After a failure of the disk this does nothing: the car goes on, and commit() tells. */
  void write(Arrival arrival);
  /** Nothing may be written after it. \throws InputError if the disk was full. */
  void commit();
  [[nodiscard]] std::size_t written() const { return x_written; }  ///< after commit()

 private:
  LogWriter x_writer;  ///< this and the next two: of the thread alone while it runs
  std::size_t x_written = 0;
  std::exception_ptr x_error;
  BoundedQueue<Arrival> x_queue{256};
  std::thread x_thread;
};

}  // namespace raceloc
