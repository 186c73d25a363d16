"""From a picture to a curve: solves for the change of a curve that makes pixels as bright as they are to be."""
