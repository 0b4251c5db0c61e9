"""One module per message kind: conversion of events from and to ROS messages, Foxglove messages and CSV rows.

* `from_ros(message, topic)` takes a decoded message and raises UnusableMessageError if it cannot become an event.
* `to_ros(event, topic)` returns encoded messages; without `topic`, for the kind's default topic.
* `from_csv(rows)` takes the rows of one event, and raises ValueError if a field cannot be read.
* `to_csv(event, pictures)` returns the fields of each row, without the stamp. Images and depths are written with `pictures`.
* `unusable_reason(event)` checks the values of an event.
"""
