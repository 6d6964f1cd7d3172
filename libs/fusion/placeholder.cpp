namespace raceloc {}
